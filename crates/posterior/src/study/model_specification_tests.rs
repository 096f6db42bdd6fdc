use super::*;

fn read(text: &str) -> Result<ModelSpecification> {
    ModelSpecification::from_text(Path::new("model.toml"), text.as_bytes(), &Library::default())
}

#[test]
fn what_is_written_is_read_back_to_the_bit() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("model.toml");
    let mut specification = ModelSpecification::default();
    specification.fixed.insert("young_modulus_pa".into(), 0.1 + 0.2);
    specification.fixed.insert("noise_sd_um".into(), 1e-300);
    specification.prior = "my \"own\" prior.toml".into();
    specification.base = BaseLaw::Burgers;
    specification.effects = vec!["clock-offset".into()];
    specification.noise = ["white", "ou", "gain", "student"].map(String::from).into();
    specification.fixed.insert("clock-offset.delay_s".into(), 0.0);
    specification.write(&path).unwrap();
    assert_eq!(ModelSpecification::read(&path, &Library::default()).unwrap(), specification);
}

#[test]
fn a_network_is_read_and_written_back() {
    let text = "base = { network = { series = [\
        { parallel = [{ spring = \"gel\" }, { springpot = \"mesh\" }] }, { dashpot = \"flow\" }] } }\n\
        effects = [\"clock-offset\"]\n[fixed]\nmesh_order = 0.5\n";
    let specification = read(text).unwrap();
    let names: Vec<&str> = specification.base.parameters().iter().map(|p| p.name).collect();
    assert_eq!(names, ["gel_modulus_pa", "mesh_modulus_pa", "mesh_order", "flow_viscosity_pa_s"]);
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("model.toml");
    specification.write(&path).unwrap();
    assert_eq!(ModelSpecification::read(&path, &Library::default()).unwrap(), specification);
}

#[test]
fn a_base_alone_is_the_default_model() {
    assert_eq!(read("base = \"lethersich\"").unwrap(), ModelSpecification::default());
    assert_eq!(
        ModelSpecification::default().with_options(None, &[], &[], None, &[]).unwrap(),
        ModelSpecification::default()
    );
}

#[test]
fn unacceptable_models_are_refused_with_line_key_and_remedy() {
    let cases = [
        ("effects = []\n", 1, "base", "missing", "base = \"lethersich\""),
        ("base = \"letersich\"", 1, "base", "`letersich`", "did you mean `lethersich`"),
        ("\nbase = { network = \"x\" }", 2, "base.network", "table", "network"),
        ("base = { net = { } }", 1, "base.net", "unknown key", "network"),
        ("base = \"zener\"", 1, "base", "`zener`", "lethersich"),
        (
            "base = \"lethersich\"\neffects = [\"clock-ofset\"]",
            2,
            "effects",
            "`clock-ofset`",
            "did you mean `clock-offset`",
        ),
        ("base = \"lethersich\"\neffects = \"inertia\"", 2, "effects", "expected a list", "effects = "),
        ("base = \"lethersich\"\n\nnoise = [\"white\", \"pink\"]", 3, "noise", "`pink`", "student"),
        (
            "base = \"lethersich\"\neffects = [\"clock-offset\"]\n[fixed]\n\"clock-offset.delay_s\" = -1",
            4,
            "fixed.clock-offset.delay_s",
            "outside its support",
            "inside [0, ∞) in s",
        ),
        ("base = \"lethersich\"\nnoise = [\"white\", \"white\"]", 2, "noise", "twice", "once"),
        ("base = \"lethersich\"\nnoise = []", 2, "noise", "no `white`", "white"),
        ("base = \"lethersich\"\npriors = \"x\"", 2, "priors", "unknown key", "did you mean `prior`"),
        (
            "base = \"lethersich\"\n[fixed]\nyoung_modulus = 3.0",
            3,
            "fixed.young_modulus",
            "unknown parameter",
            "did you mean `young_modulus_pa`",
        ),
        (
            "base = \"lethersich\"\n[fixed]\nyoung_modulus_pa = 0",
            3,
            "fixed.young_modulus_pa",
            "outside its support",
            "above 0 in Pa",
        ),
        (
            "base = \"lethersich\"\n[fixed]\nyoung_modulus_pa = nan",
            3,
            "fixed.young_modulus_pa",
            "not a finite",
            "finite",
        ),
        ("base = \"lethersich\"\nbase = \"lethersich\"", 2, "", "not valid TOML", "each key once"),
    ];
    for (text, line, key, found, remedy) in cases {
        let Err(Error::Input { place, found: was, remedy: advice }) = read(text) else { panic!("accepted: {text}") };
        assert_eq!((place.line, place.key.as_deref().unwrap_or("")), (Some(line), key), "{text}: {was}");
        assert!(was.contains(found) && advice.contains(remedy), "{text}: {was} / {advice}");
    }
}

#[test]
fn options_are_refused_by_their_names() {
    let refused = |base: Option<&str>, with: &[&str], noise: &[&str], set: &[&str]| {
        let function = |texts: &[&str]| texts.iter().map(|text| text.to_string()).collect::<Vec<_>>();
        match ModelSpecification::default().with_options(base, &function(with), &function(noise), None, &function(set))
        {
            Err(Error::Input { place, .. }) => place.key.unwrap(),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(refused(Some("zener"), &[], &[], &[]), "base");
    assert_eq!(refused(None, &["astrology"], &[], &[]), "effects");
    assert_eq!(refused(None, &[], &["pink"], &[]), "noise");
    for set in [
        &["young_modulus_pa"][..],
        &["young_modulus_pa=x"],
        &["e=1"],
        &["young_modulus_pa=-1"],
        &["noise_sd_um=1", "noise_sd_um=2"],
    ] {
        assert_eq!(refused(None, &[], &[], set), "fixed");
    }
    let set = ["young_modulus_pa = 3.5".to_string()];
    let specification = ModelSpecification::default().with_options(None, &[], &[], Some("generic"), &set).unwrap();
    assert_eq!((specification.fixed["young_modulus_pa"], specification.prior.as_str()), (3.5, "generic"));
}

/// A mobility is fixed at 0 unless the user sets or frees it. Only optional parameters can be freed. `model.toml` stores the choice.
#[test]
fn an_optional_parameter_is_held_at_its_null_until_it_is_freed() {
    use models::effects::MOBILITY;
    let library = Library::default();
    let held = |set: &[&str]| {
        let set: Vec<String> = set.iter().map(|text| text.to_string()).collect();
        let made = ModelSpecification::default().with_options(None, &["large-displacement".into()], &[], None, &set)?;
        Ok::<_, Error>(made)
    };
    let scales = crate::replica::embedded().unwrap().0.scales();
    let value = |made: ModelSpecification| made.with_nulls(&scales, &library).fixed.get(MOBILITY).copied();
    assert_eq!(value(held(&[]).unwrap()), Some(0.0));
    assert_eq!(value(held(&["large-displacement.mobility=0.02"]).unwrap()), Some(0.02));
    let whole = held(&[]).unwrap().with_nulls(&scales, &library);
    let without = ModelSpecification { effects: Vec::new(), ..whole }.with_nulls(&scales, &library);
    assert!(without.fixed.is_empty(), "{:?}", without.fixed);
    let freed = held(&["large-displacement.mobility=free"]).unwrap();
    assert_eq!(value(freed.clone()), None);
    for set in ["large-displacement.amplitude=free", "young_modulus_pa=free"] {
        let refusal = held(&[set]).unwrap_err().to_string();
        assert!(refusal.contains("is free already") && refusal.contains(MOBILITY), "{refusal}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.toml");
    freed.write(&path).unwrap();
    assert_eq!(ModelSpecification::read(&path, &library).unwrap(), freed);
}
