//! Maps settings of the library to options of this program. The library's errors name settings, the program's errors name options.

use vitreo_uq::base::error::Setting;

/// Returns the name of the option for a setting.
pub fn option(setting: Setting) -> &'static str {
    match setting {
        Setting::Base => "--base",
        Setting::Effects => "--with",
        Setting::Noise => "--noise",
        Setting::Prior => "--prior",
        Setting::Fixed => "--set",
        Setting::Forward => "--forward",
        Setting::ForwardModel => "--forward-model",
        Setting::Mesh => "--mesh",
        Setting::MeshUnit => "--mesh-unit",
        Setting::Revision => "--from",
        Setting::Chains => "--chains",
        Setting::Steps => "--steps",
        Setting::Resume => "--resume",
        Setting::Threads => "--threads",
        Setting::Out => "--out",
        Setting::Force | Setting::ForceColumn | Setting::ForceTable => "--force",
        Setting::Scenario => "--scenario",
        Setting::After => "--after",
        Setting::NewEye => "--new-eye",
        Setting::LargestForce => "--max-force-un",
        Setting::Replace => "--replace",
        Setting::Scheme => "--scheme",
        Setting::TimeStep => "--time-step-s",
        Setting::Refine => "--refine",
        Setting::FirstCycles => "--first-cycles",
        Setting::By => "--by",
        Setting::LeaveOut => "--leave-out",
        Setting::TimeColumn => "--time",
        Setting::PositionColumn => "--position",
        Setting::CycleColumn => "--cycle",
        Setting::XColumn => "--x",
        Setting::YColumn => "--y",
        Setting::ZColumn => "--z",
        Setting::FrequencyColumn => "--frequency",
        Setting::ModuliColumns => "--moduli",
        Setting::Tables => "--table",
        Setting::Kind => "--kind",
        Setting::TrackColumn => "--track-column",
        Setting::Track => "--track",
        Setting::LoadStart => "--load-start",
        Setting::BlankForce => "--blank-force",
        Setting::ForceFile => "--force-file",
        Setting::Thousands => "--thousands",
        Setting::TimeRestarts => "--time-restarts",
        Setting::TimeTies => "--time-ties",
        Setting::TimeUnit => "--unit-time",
        Setting::FrequencyUnit => "--unit-frequency",
        Setting::ModuliUnit => "--unit-moduli",
        Setting::ForceUnit => "--unit-force",
        Setting::PositionUnit => "--unit-position",
        Setting::RobotDiameter => "--robot-diameter-mm",
        Setting::TipRadius => "--tip-radius-um",
        Setting::CantileverStiffness => "--cantilever-n-per-m",
        Setting::SpecimenLength => "--specimen-length-mm",
        Setting::SpecimenArea => "--specimen-area-mm2",
        Setting::Task => "--task",
        Setting::Part => "--part",
        Setting::Parts => "--parts",
        Setting::Cores => "--cores",
        Setting::Minutes => "--minutes",
        Setting::Memory => "--memory-mib",
        Setting::Count => "--count",
        Setting::HiddenEffect => "--effect",
        Setting::Pair => "--pair",
        Setting::Outside => "--outside",
        Setting::Strength => "--strength",
        Setting::Size => "--size",
        Setting::Signal => "--signal",
        Setting::Protocol => "--protocol",
        Setting::Cache => "--cache",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use clap::CommandFactory;

    fn has_option(command: &clap::Command, option: &str) -> bool {
        command
            .get_arguments()
            .any(|argument| argument.get_long().is_some_and(|long| Some(long) == option.strip_prefix("--")))
            || command.get_subcommands().any(|command| has_option(command, option))
    }

    #[test]
    fn every_setting_has_an_option_of_some_command() {
        let program = crate::Program::command();
        for setting in Setting::ALL {
            assert!(has_option(&program, option(setting)), "{setting:?}: no command has {}", option(setting));
        }
        assert!(!has_option(&program, "--no-such-option"));
    }
}
