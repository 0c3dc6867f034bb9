//! Parameters of the simulated pack; not on the board.

use super::{Access, Bearing, Documentation, Kind, Parameter, Range, means};

parameters! {
    /// A parameter of the simulated pack.
    SimulationParameter

    BattVoltage {
        key: 2048,
        name: "SIM_BATT_VOLTAGE",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(0.0, 60.0),
        access: Access::Setting(Bearing::Service),
    } Documentation {
        label: "Simulated pack voltage",
        description: "Resting voltage of the simulated pack. 0: from its state of charge. \
                      The simulated divider saturates at 13 V, as the board's.",
        unit: "V",
        step: 0.1,
    }
    BattCapAh {
        key: 2049,
        name: "SIM_BATT_CAP_AH",
        kind: Kind::Real32,
        default: 2.2,
        range: Range::Between(0.1, 1000.0),
        access: Access::Setting(Bearing::Service),
    } Documentation {
        label: "Simulated pack capacity",
        description: "Full capacity of the simulated pack. A change keeps the state of charge.",
        unit: "Ah",
        step: 0.1,
    }
    BattCurrent {
        key: 2050,
        name: "SIM_BATT_CURRENT",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(-100.0, 500.0),
        access: Access::Setting(Bearing::Service),
    } Documentation {
        label: "Simulated extra load",
        description: "Load in addition to the rover's own; negative to charge the pack.",
        unit: "A",
        step: 0.1,
    }
    BattFault {
        key: 2051,
        name: "SIM_BATT_FAULT",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(&[
            (0, means("None")),
            (1, means("ADC does not answer")),
            (2, means("Sense wire disconnected")),
            (3, means("Noise of 0.5 V")),
            (4, means("First cell 1 V lower")),
            (5, means("I2C wire disconnected")),
        ]),
        access: Access::Setting(Bearing::Service),
    } Documentation {
        label: "Simulated fault",
        description: "Fault of the simulated pack or its sensor. Cells are measured by its smart battery only.",
    }
}
