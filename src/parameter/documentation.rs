//! Generated documentation of the parameters: a page of the docs, and files for ground stations, ArduPilot's metadata file and
//! MAVLink's component metadata.

mod component_metadata;

use std::fmt::Write;

use super::named::NEWER_NAMES;
use super::{
    Access, BatteryParameter, Parameter, ParameterId, Range, SimulationParameter, StickParameter,
    TakesEffect, TemperatureSensor, ThermometerParameter, VehicleParameter,
};
use crate::pack::Pack;

pub use component_metadata::{general_json, parameters_json};

/// Parameters that have another name from ArduPilot 4.7 on (ArduPilot's wiki, "Parameter Name Changes"), and what else differs.
fn difference_of_newer_name(parameter: VehicleParameter) -> &'static str {
    match parameter {
        VehicleParameter::Sr0Extra1 => {
            "there it sets neither SYS_STATUS (`MAV1_EXT_STAT`) nor BATTERY_STATUS (`MAV1_EXTRA3`)"
        }
        VehicleParameter::ArmingCheck => {
            "inverted: the sum of the checks to skip, with the same bits except bit 0; 0 checks all (here 1), -1 none (here 0)"
        }
        _ => "the same",
    }
}

/// The page `docs/parameters.md`.
pub fn markdown() -> String {
    let mut page = String::from(
        "# Parameters\n\n\
         Written by `cargo run --example parameter_docs`. Names are ArduPilot 4.6's unless noted. A change takes effect at \
         once, or after a restart where that is noted, and is saved to flash, but for values that are read only or return \
         to 0.\n",
    );
    let vehicle = VehicleParameter::ALL.into_iter().map(ParameterId::from);
    write_table(&mut page, "\n## Vehicle\n", vehicle).expect("infallible");
    let sticks = "\n\
         ## Sticks\n\
         Of the driver's sticks in RC_CHANNELS_OVERRIDE; MANUAL_CONTROL has axes of its own. Channels 5 to 8 go from 1000 to 2000 \
         µs. Changes are taken in any order. Two axes on one channel, or less than 100 µs to a side of the neutral pulse, do not \
         fit: arming is refused if they concern the throttle or the steering, and the last values that fitted stay in force, \
         after a restart the defaults.\n\n";
    let of_sticks = StickParameter::ALL.into_iter().map(ParameterId::from);
    write_table(&mut page, sticks, of_sticks).expect("infallible");
    let thermometers = "\n\
         ## Thermometers\n\
         `TEMP2_…` and `TEMP3_…` are the same for two more. While a type is 0, the other parameters are not listed.\n\n";
    let of_first = ThermometerParameter::ALL
        .into_iter()
        .map(|parameter| parameter.of(TemperatureSensor::First));
    write_table(&mut page, thermometers, of_first).expect("infallible");
    let packs = "\n\
         ## Packs\n\
         Of the first pack; `BATT2_…` to `BATT9_…` are the same for the others. While a pack's `MONITOR` is 0, its other \
         parameters are not listed, but can be read and set by name; so are those of kinds of monitors and devices that are \
         not in use. After enabling one, read the list again: some ground stations set only parameters they have \
         read.\n\n";
    let first_pack = BatteryParameter::ALL
        .into_iter()
        .map(|parameter| parameter.of(Pack::First));
    write_table(&mut page, packs, first_pack).expect("infallible");
    let simulator = SimulationParameter::ALL.into_iter().map(ParameterId::from);
    write_table(&mut page, "\n## Simulator only\n", simulator).expect("infallible");
    let constants = "\n\
         ## For ground stations\n\
         QGroundControl asks for these before it calls a rover set up. They are constant: what they would set up is not there, \
         or does not depend on a setting here.\n\n";
    let of_ground_stations = ParameterId::all().filter(|id| id.row().access == Access::Constant);
    write_table(&mut page, constants, of_ground_stations).expect("infallible");
    write_renamed(&mut page).expect("infallible");
    page
}

fn write_renamed(page: &mut String) -> std::fmt::Result {
    page.push_str(
        "\n\
         ## Names of ArduPilot 4.7\n\
         ArduPilot 4.7 has renamed these. They are read and set by these names, too, also by files; lists have the older ones. \
         Names of packs are the same.\n\n\
         | here, as up to 4.6 | 4.7 | meaning there |\n|---|---|---|\n",
    );
    for (renamed, parameter) in NEWER_NAMES {
        let difference = difference_of_newer_name(parameter);
        let name = ParameterId::from(parameter).name();
        writeln!(page, "| `{name}` | `{renamed}` | {difference} |")?;
    }
    Ok(())
}

fn write_table(
    page: &mut String,
    introduction: &str,
    parameters: impl Iterator<Item = ParameterId>,
) -> std::fmt::Result {
    page.push_str(introduction);
    page.push_str("| parameter | meaning | values | default |\n|---|---|---|---|\n");
    for id in parameters {
        write_row(page, id)?;
    }
    Ok(())
}

fn write_row(page: &mut String, id: ParameterId) -> std::fmt::Result {
    let row = id.row();
    let note = match (row.documentation.takes_effect, row.access) {
        (_, Access::ReadOnly | Access::Constant) => " (read only)",
        (_, Access::Trigger) => " (returns to 0)",
        (TakesEffect::AfterReboot, Access::Setting(_)) => " (restart)",
        (TakesEffect::AtOnce, Access::Setting(_)) => "",
    };
    writeln!(
        page,
        "| `{}`{note} | {} | {} | {}{} |",
        id.name(),
        row.documentation.description,
        values(row),
        id.default_value(),
        other_default(id)
    )
}

/// The values a parameter can have.
fn values(row: &Parameter) -> String {
    match row.range {
        Range::Between(lowest, highest) if lowest == highest => format!("{lowest}"),
        Range::Between(lowest, highest) => {
            let values = format!("{lowest} to {highest} {}", row.documentation.unit);
            values.trim_end().into()
        }
        Range::ZeroOrBetween(lowest, highest) => format!("0, {lowest} to {highest}"),
        Range::OneOf(values) => joined(
            values
                .iter()
                .map(|(code, meaning)| format!("{code} ({})", meaning.text())),
        ),
        Range::Bits(bits) => {
            let bits = bits
                .iter()
                .map(|(bit, meaning)| format!("{} (bit {bit}: {})", 1 << bit, meaning.text()));
            format!("the sum of {}", joined(bits))
        }
    }
}

fn joined(items: impl Iterator<Item = String>) -> String {
    items.collect::<Vec<_>>().join(", ")
}

/// The default of the other packs, if it differs.
fn other_default(id: ParameterId) -> String {
    if id.default_value() == id.row().default {
        String::new()
    } else {
        format!("; other packs: {}", id.row().default)
    }
}

/// The file `apm.pdef.xml` of a release, in the format of ArduPilot's parameter metadata.
pub fn apm_pdef_xml() -> String {
    let mut xml = String::from(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n\
         <!-- Written by the example parameter_docs -->\n\
         <paramfile>\n  <vehicles>\n    <parameters name=\"Rover\">\n",
    );
    for id in ParameterId::all() {
        write_param(&mut xml, id).expect("infallible");
    }
    xml.push_str("    </parameters>\n  </vehicles>\n  <libraries/>\n</paramfile>\n");
    xml
}

fn write_param(xml: &mut String, id: ParameterId) -> std::fmt::Result {
    let row = id.row();
    let about = &row.documentation;
    writeln!(
        xml,
        "      <param humanName=\"{}\" name=\"Rover:{}\" documentation=\"{}\" user=\"Standard\">",
        escape(about.label),
        id.name(),
        escape(about.description)
    )?;
    write_range(xml, row)?;
    if !about.unit.is_empty() {
        writeln!(
            xml,
            "        <field name=\"Units\">{}</field>",
            escape(about.unit)
        )?;
    }
    if about.takes_effect == TakesEffect::AfterReboot {
        writeln!(xml, "        <field name=\"RebootRequired\">True</field>")?;
    }
    if matches!(row.access, Access::ReadOnly | Access::Constant) {
        // Ground stations leave a volatile one out when they compare files of parameters.
        writeln!(xml, "        <field name=\"ReadOnly\">True</field>")?;
        writeln!(xml, "        <field name=\"Volatile\">True</field>")?;
    }
    writeln!(xml, "      </param>")
}

fn write_limits(xml: &mut String, lowest: f32, highest: f32, row: &Parameter) -> std::fmt::Result {
    writeln!(xml, "        <field name=\"Range\">{lowest} {highest}</field>")?;
    writeln!(
        xml,
        "        <field name=\"Increment\">{}</field>",
        row.documentation.step
    )
}

fn write_range(xml: &mut String, row: &Parameter) -> std::fmt::Result {
    match row.range {
        Range::Between(lowest, highest) => write_limits(xml, lowest, highest, row)?,
        // The format has no gap in a range.
        Range::ZeroOrBetween(_, highest) => write_limits(xml, 0.0, highest, row)?,
        Range::OneOf(values) => {
            writeln!(xml, "        <values>")?;
            for (code, meaning) in values {
                writeln!(
                    xml,
                    "          <value code=\"{code}\">{}</value>",
                    escape(meaning.text())
                )?;
            }
            writeln!(xml, "        </values>")?;
        }
        Range::Bits(bits) => {
            let bits: Vec<_> = bits
                .iter()
                .map(|(bit, meaning)| format!("{bit}:{}", escape(meaning.text())))
                .collect();
            writeln!(xml, "        <field name=\"Bitmask\">{}</field>", bits.join(","))?;
        }
    }
    Ok(())
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_ardupilot_4_7_are_listed() {
        let page = markdown();
        for (renamed, _) in NEWER_NAMES {
            assert!(page.contains(&format!("| `{renamed}` |")));
        }
    }

    #[test]
    fn xml_comment_is_valid() {
        let xml = apm_pdef_xml();
        let (_, rest) = xml.split_once("<!--").expect("its start");
        let (comment, _) = rest.split_once("-->").expect("its end");
        assert!(!comment.contains("--"), "{comment}");
    }

    #[test]
    fn meanings_of_bits_have_no_separators() {
        for id in ParameterId::all() {
            if let Range::Bits(bits) = id.row().range {
                assert!(
                    bits.iter()
                        .all(|(_, meaning)| !meaning.text().contains([',', ':']))
                );
            }
        }
    }

    #[test]
    fn text_for_attributes_is_escaped() {
        assert_eq!(escape("a < b & \"c\""), "a &lt; b &amp; &quot;c&quot;");
    }
}
