//! The parameters of the simulated pack. The board does not have them.

use super::{Documentation, Kind, Parameter, Range, TakesEffect, means};

parameters! {
    /// A parameter of the simulated pack.
    SimulationParameter

    BattVoltage {
        key: 2048,
        name: "SIM_BATT_VOLTAGE",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(0.0, 60.0),
        step: 0.1,
        unit: "V",
        takes_effect: TakesEffect::AtOnce,
        label: "Simulated pack's voltage",
        description: "The resting voltage the simulated pack has from now on. 0 lets it follow its charge. \
                      The board's divider, which is simulated too, ends at 13 V.",
    }
    BattCapAh {
        key: 2049,
        name: "SIM_BATT_CAP_AH",
        kind: Kind::Real32,
        default: 2.2,
        range: Range::Between(0.1, 1000.0),
        step: 0.1,
        unit: "Ah",
        takes_effect: TakesEffect::AtOnce,
        label: "Simulated pack's capacity",
        description: "The charge of the simulated pack when it is full. A change keeps its state of charge.",
    }
    BattCurrent {
        key: 2050,
        name: "SIM_BATT_CURRENT",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(-100.0, 500.0),
        step: 0.1,
        unit: "A",
        takes_effect: TakesEffect::AtOnce,
        label: "Simulated extra load",
        description: "A load of the simulated pack besides the rover; negative to charge it.",
    }
    BattFault {
        key: 2051,
        name: "SIM_BATT_FAULT",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(&[
            (0, means("None")),
            (1, means("Converter does not answer")),
            (2, means("Sense wire is off")),
            (3, means("Noise of half a volt")),
        ]),
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Simulated fault",
        description: "What is wrong with the measurement of the simulated pack.",
    }
}
