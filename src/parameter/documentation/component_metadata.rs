//! The descriptions in the format of MAVLink's component metadata.

use super::super::{
    Access, DescriptionFile, Kind, Meaning, Parameter, ParameterId, Range, TakesEffect, TemperatureSensor,
};
use crate::memory::checksum::file_crc32;
use crate::pack::Pack;

/// Version of both formats.
const VERSION: u8 = 1;

/// `COMP_METADATA_TYPE_PARAMETER`.
const TYPE_PARAMETER: u8 = 1;

/// Stands for a pack's or thermometer's number in a name.
const INDEX: &str = "{n}";

/// The file `parameters.json`, which is served compressed.
///
/// A pack's parameter has two rows: by the name that it has of the first pack, and by one with an index for all others. That of a
/// thermometer has one for all. The index has more characters than the digit it stands for, so such a name may be longer than
/// any on the wire.
pub fn parameters_json() -> String {
    let rows: Vec<String> = ParameterId::all()
        .filter_map(|id| Some(parameter_json(id, &name(id)?)))
        .collect();
    format!(
        "{{\"version\":{VERSION},\"parameters\":[\n{}\n]}}\n",
        rows.join(",\n")
    )
}

/// The file `docs/general.json`, which names the file of descriptions and has the checksum of `parameters`, its bytes.
pub fn general_json(parameters: &[u8]) -> String {
    format!(
        "{{\"version\":{VERSION},\"metadataTypes\":[\n\
         {{\"type\":{TYPE_PARAMETER},\"uri\":\"mftp://{}\",\"fileCrc\":{}}}\n]}}\n",
        DescriptionFile::Parameters.name(),
        file_crc32(0, parameters)
    )
}

/// The name in the file; `None` if another row describes this parameter, too.
fn name(id: ParameterId) -> Option<String> {
    match id {
        ParameterId::Battery(Pack::Second, parameter) => {
            Some(format!("BATT{INDEX}_{}", parameter.row().name))
        }
        ParameterId::Battery(pack, _) if pack != Pack::First => None,
        ParameterId::Thermometer(TemperatureSensor::First, parameter) => {
            Some(format!("TEMP{INDEX}_{}", parameter.row().name))
        }
        ParameterId::Thermometer(..) => None,
        _ => Some(id.name().as_str().into()),
    }
}

fn parameter_json(id: ParameterId, name: &str) -> String {
    let row = id.row();
    let about = &row.documentation;
    let mut fields = vec![
        field("name", quoted(name)),
        field("type", quoted(type_name(row.kind))),
        field("group", quoted(group(name))),
        field("category", quoted(category(row))),
        field("shortDesc", quoted(about.label)),
        field("longDesc", quoted(about.description)),
        field("default", id.default_value().to_string()),
    ];
    if !about.unit.is_empty() {
        fields.push(field("units", quoted(about.unit)));
    }
    if row.kind == Kind::Real32 {
        fields.push(field("decimalPlaces", decimal_places(row).to_string()));
    }
    fields.extend(range(row));
    fields.extend(flags(row));
    format!("{{{}}}", fields.join(","))
}

fn field(key: &str, value: String) -> String {
    format!("\"{key}\":{value}")
}

/// A string. The texts have no control characters.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

fn type_name(kind: Kind) -> &'static str {
    match kind {
        Kind::Int8 => "Int8",
        Kind::Int16 => "Int16",
        Kind::Int32 => "Int32",
        Kind::Real32 => "Float",
    }
}

/// The group of a parameter in a ground station's list.
fn group(name: &str) -> &str {
    name.split(['_', '{']).next().unwrap_or(name)
}

/// "Standard" is what QGroundControl lists first.
fn category(row: &Parameter) -> &'static str {
    if row.access == Access::Constant {
        "For ground stations"
    } else {
        "Standard"
    }
}

/// Digits behind the point: what was calibrated is finer than the step by which a value is changed.
fn decimal_places(row: &Parameter) -> usize {
    let digits = |value: f32| {
        value
            .to_string()
            .split_once('.')
            .map_or(0, |(_, digits)| digits.len())
    };
    match digits(row.documentation.step) {
        0 => digits(row.default),
        of_step => of_step + 1,
    }
}

/// A constant has no range.
fn range(row: &Parameter) -> Vec<String> {
    match row.range {
        _ if row.access == Access::Constant => Vec::new(),
        Range::Between(lowest, highest) => limits(lowest, highest, row),
        // The format has no gap in a range.
        Range::ZeroOrBetween(_, highest) => limits(0.0, highest, row),
        Range::OneOf(values) => vec![field("values", described("value", values))],
        Range::Bits(bits) => vec![field("bitmask", described("index", bits))],
    }
}

fn limits(lowest: f32, highest: f32, row: &Parameter) -> Vec<String> {
    vec![
        field("min", lowest.to_string()),
        field("max", highest.to_string()),
        field("increment", row.documentation.step.to_string()),
    ]
}

/// An array of numbers with their meanings.
fn described<N: Copy + ToString>(key: &str, numbers: &[(N, Meaning)]) -> String {
    let items: Vec<_> = numbers
        .iter()
        .map(|(number, meaning)| {
            let (number, meaning) = (
                field(key, number.to_string()),
                field("description", quoted(meaning.text())),
            );
            format!("{{{number},{meaning}}}")
        })
        .collect();
    format!("[{}]", items.join(","))
}

/// The flags that are set; all are false by default.
fn flags(row: &Parameter) -> Vec<String> {
    let mut flags = Vec::new();
    if row.documentation.takes_effect == TakesEffect::AfterReboot {
        flags.push("rebootRequired");
    }
    if matches!(row.access, Access::ReadOnly | Access::Constant) {
        // Ground stations leave a volatile one out when they save or compare files of parameters.
        flags.extend(["readOnly", "volatile"]);
    }
    flags.into_iter().map(|flag| field(flag, "true".into())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameter::MAX_NAME_LENGTH;

    /// The names in the file, in its order.
    fn names() -> Vec<String> {
        let json = parameters_json();
        let rows = json.lines().filter_map(|row| row.strip_prefix("{\"name\":\""));
        rows.map(|row| row.split('"').next().expect("a name").into())
            .collect()
    }

    /// Whether QGroundControl takes `row`, with an index, for `name`: it looks for it anywhere in the name, and takes the last row
    /// that fits (CompInfoParam.cc).
    fn fits(row: &str, name: &str) -> bool {
        let Some((before, behind)) = row.split_once(INDEX) else {
            return false;
        };
        name.match_indices(before).any(|(at, _)| {
            let rest = &name[at + before.len()..];
            let index = rest.trim_start_matches(|c: char| c.is_ascii_digit());
            index.len() < rest.len() && index.starts_with(behind)
        })
    }

    #[test]
    fn every_name_has_its_own_row() {
        let names = names();
        for id in ParameterId::all() {
            let name = id.name();
            let expected = match id {
                ParameterId::Battery(pack, parameter) if pack != Pack::First => {
                    format!("BATT{INDEX}_{}", parameter.row().name)
                }
                ParameterId::Thermometer(_, parameter) => format!("TEMP{INDEX}_{}", parameter.row().name),
                _ => name.as_str().into(),
            };
            let same = names.iter().find(|row| *row == name.as_str());
            let row = same.or_else(|| names.iter().rev().find(|row| fits(row, &name)));
            assert_eq!(row, Some(&expected), "{name}");
        }
    }

    #[test]
    fn no_name_is_described_twice_and_each_is_as_long_as_on_the_wire() {
        let mut names = names();
        for name in &names {
            assert!(name.replace(INDEX, "2").len() <= MAX_NAME_LENGTH, "{name}");
        }
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count);
    }

    #[test]
    fn texts_have_no_control_characters() {
        assert!(
            parameters_json()
                .lines()
                .all(|line| !line.contains(char::is_control))
        );
    }

    #[test]
    fn texts_are_quoted() {
        assert_eq!(quoted("a \"b\" \\"), "\"a \\\"b\\\" \\\\\"");
    }

    #[test]
    fn ranges_fit_their_types() {
        for id in ParameterId::all() {
            let limits = match id.row().kind {
                Kind::Int8 => f32::from(i8::MIN)..=f32::from(i8::MAX),
                Kind::Int16 => f32::from(i16::MIN)..=f32::from(i16::MAX),
                Kind::Int32 | Kind::Real32 => f32::MIN..=f32::MAX,
            };
            let fits = match id.row().range {
                Range::Between(lowest, highest) | Range::ZeroOrBetween(lowest, highest) => {
                    limits.contains(&lowest) && limits.contains(&highest)
                }
                Range::OneOf(values) => values.iter().all(|(value, _)| limits.contains(&(*value as f32))),
                Range::Bits(bits) => bits.iter().all(|(bit, _)| limits.contains(&((1 << bit) as f32))),
            };
            assert!(fits, "{}", id.name());
        }
    }

    #[test]
    fn values_have_as_many_digits_as_were_calibrated() {
        let digits = |name: &str| {
            let id = ParameterId::from_name(name.as_bytes()).expect(name);
            decimal_places(id.row())
        };
        assert_eq!(
            ["BATT_VOLT_MULT", "BATT_LOW_MAH", "INS_ACCOFFS_X"].map(digits),
            [3, 0, 2]
        );
    }
}
