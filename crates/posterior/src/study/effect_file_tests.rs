use super::*;
use crate::study::ModelSpecification;
use models::effects::Library;

const HARDENING: &str = r#"
name = "test-hardening"
quantity = "young_modulus_pa"
state = "path"
factor = "(1 + gain * path / length)^2 + 0 * gain"

[parameters.gain]
unit = "1"
null = 0.0
lower = 0.0
prior = { distribution = "half_normal", sd = 0.5 }

[parameters.length]
unit = "m"
lower = 0.0
prior = { distribution = "log_normal", median = 1e-3, log_sd = 0.5 }
"#;

fn read(text: &str) -> Result<&'static str> {
    from_text(Path::new("effect.toml"), text)
}

/// The effect computes what its file defines. Its name can be used afterwards, and a `model.toml` that names it contains its definition.
#[test]
fn an_effect_is_what_its_file_says() {
    assert_eq!(read(HARDENING).unwrap(), "test-hardening");
    assert_eq!(read(HARDENING).unwrap(), "test-hardening", "the same again is the same");
    let effect = Library::default().get("test-hardening").expect("defined");
    assert!(Library::default().effects().iter().all(|effect| effect.slug() != "test-hardening"), "no search finds it");
    let names: Vec<&str> = effect.parameters().iter().map(|parameter| parameter.spec.name).collect();
    assert_eq!(names, ["test-hardening.gain", "test-hardening.length"]);
    let mut stages = laws::stages::Stages::of_law(Vec::new());
    stages.base = Some(BaseLaw::Lethersich);
    effect
        .apply(&[Dual::constant(0.5), Dual::constant(1e-3)], &record::CharacteristicSizes::default(), &mut stages)
        .unwrap();
    let law = stages.state_law.expect("written");
    assert!((law.value(Dual::constant(2e-3)).value - 4.0).abs() < 1e-15);
    let specification = ModelSpecification { effects: vec!["test-hardening".into()], ..ModelSpecification::default() };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("model.toml");
    specification.write(&path).unwrap();
    assert!(std::fs::read_to_string(&path).unwrap().contains("[[effect]]"));
    assert_eq!(ModelSpecification::read(&path, &Library::default()).unwrap(), specification);
}

#[test]
fn mistakes_are_named_with_their_place_and_remedy() {
    let with = |from: &str, to: &str| HARDENING.replace("test-hardening", "test-mistake").replace(from, to);
    let cases = [
        (with("state = \"path\"", "state = \"pth\""), "did you mean `path`"),
        (with("\"young_modulus_pa\"", "\"colour\""), "cannot depend on a state"),
        (with("(1 + gain", "(1 + gian"), "column 6"),
        (with("path / length", "1 / length"), "does not depend on path"),
        (with("(1 + gain * path / length)^2", "1.5 + gain * path / length"), "as in the model without the effect"),
        (with("null = 0.0", ""), "no parameter has a null"),
        (with("null = 0.0", "null = -1.0"), "inside the parameter's ends"),
        (with("\"half_normal\", sd = 0.5", "\"normal\", mean = 0.0, sd = 0.5"), "narrow the prior"),
        (with("factor", "factr"), "did you mean `factor`"),
        (with("name = \"test-mistake\"", "name = \"softening\""), "built-in effect"),
        (
            with(
                "[parameters.length]",
                "[parameters.idle]\nunit = \"1\"\nprior = { distribution = \"normal\", mean = 0.0, sd = 1.0 }\n[parameters.length]",
            ),
            "does not occur",
        ),
        (HARDENING.replace("sd = 0.5 }", "sd = 0.7 }"), "already the name of another effect"),
    ];
    read(HARDENING).unwrap();
    for (text, remedy) in cases {
        let message = read(&text).expect_err(remedy).to_string();
        assert!(message.contains("effect.toml, line") && message.contains(remedy), "{remedy}\n{message}");
    }
}

/// The function equals the factors at the table's points and does not overshoot between them. The effect's parameter is the power of the factor.
#[test]
fn a_table_goes_through_its_points() {
    let text = r#"
name = "test-table"
quantity = "force"
state = "position"
table = { state = [-1e-4, 0.0, 1e-4, 3e-4], factor = [0.5, 1.0, 1.0, 4.0] }
[parameters.strength]
unit = "1"
null = 0.0
prior = { distribution = "normal", mean = 1.0, sd = 0.5 }
"#;
    read(text).unwrap();
    let (effect, _) = defined("test-table").expect("defined");
    let at = |state: f64, power: f64| effect.function.value(Dual::variable(state), &[Dual::constant(power)]);
    for (state, factor) in [(-1e-4, 0.5), (0.0, 1.0), (1e-4, 1.0), (3e-4, 4.0), (-1.0, 0.5), (1.0, 4.0)] {
        assert!((at(state, 1.0).value - factor).abs() < 1e-12, "{state}");
    }
    assert!((at(3e-4, 0.5).value - 2.0).abs() < 1e-12);
    for k in 0..199 {
        // The states avoid the ends of the table, where the slope is one-sided.
        let state = -1e-4 + 2e-6 * (f64::from(k) + 0.3);
        let (here, next) = (at(state, 1.0), at(state + 1e-10, 1.0));
        assert!(here.value <= next.value + 1e-15, "monotone at {state}");
        assert!(
            (here.derivative - (next.value - here.value) / 1e-10).abs() < 1e-3 * (1.0 + here.derivative.abs()),
            "{state}"
        );
    }
}
