//! Parameters that a user or a log sets.

use std::collections::HashMap;
use std::fmt;
use std::str::FromStr;

use rover_battmon::parameter::ParameterId;

/// A parameter and its value, as in `BATT_CELLS=3`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Assignment {
    /// The parameter.
    pub id: ParameterId,
    /// Its value.
    pub value: f32,
}

impl FromStr for Assignment {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, value) = text.split_once('=').ok_or("NAME=VALUE is needed")?;
        Ok(Self {
            id: ParameterId::from_name(name.as_bytes()).ok_or_else(|| format!("no parameter {name}"))?,
            value: value
                .parse()
                .map_err(|_| format!("{value:?} is not a number for {name}"))?,
        })
    }
}

impl fmt::Display for Assignment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.id.name(), self.value)
    }
}

/// The parameters of a log so far: the first value of each name holds from the beginning of the log, later ones from their time.
#[derive(Debug, Default)]
pub struct LogParameters {
    /// The latest value of each that this version has, by its name.
    latest: HashMap<String, f32>,
}

impl LogParameters {
    /// The parameter and its value, if this version has it and its name comes for the first time.
    pub fn first_value(&mut self, name: &str, value: f64) -> Option<(ParameterId, f32)> {
        let (id, value) = known(name, value)?;
        let before = self.latest.insert(name.into(), value);
        before.is_none().then_some((id, value))
    }

    /// Whether there was a value of a parameter.
    pub fn has(&self, name: &str) -> bool {
        self.latest.contains_key(name)
    }

    /// The parameter and its value, if this version has it and the value differs from the one before.
    pub fn changed_value(&mut self, name: &str, value: f64) -> Option<(ParameterId, f32)> {
        let (id, value) = known(name, value)?;
        let before = self.latest.insert(name.into(), value)?;
        (before != value).then_some((id, value))
    }
}

fn known(name: &str, value: f64) -> Option<(ParameterId, f32)> {
    Some((ParameterId::from_name(name.as_bytes())?, value as f32))
}
