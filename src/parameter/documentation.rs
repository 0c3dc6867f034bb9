//! The table as its owners read it: a page of the docs, and ArduPilot's metadata file for ground stations.

use std::fmt::Write;

use super::{Parameter, Range, TABLE, TakesEffect};

/// The page `docs/parameters.md`.
pub fn markdown() -> String {
    let mut page = String::from(
        "# Parameters\n\n\
         Written by `cargo run --example parameter_docs` from the table in `src/parameter/table.rs`; a test fails when it is \
         stale. Names are ArduPilot 4.6's. A change is live at once unless a restart is noted, and kept in flash.\n",
    );
    for row in &TABLE {
        write_section(&mut page, row).expect("a string takes everything");
    }
    page
}

fn write_section(page: &mut String, row: &Parameter) -> std::fmt::Result {
    writeln!(page, "\n## {}\n{}. {}\n", row.name, row.label, row.description)?;
    let unit = if row.unit.is_empty() {
        String::new()
    } else {
        format!(" {}", row.unit)
    };
    match row.range {
        Range::Between(lowest, highest) => {
            writeln!(
                page,
                "- range: {lowest} to {highest}{unit}, in steps of {}",
                row.step
            )?;
        }
        Range::OneOf(values) => {
            let values: Vec<_> = values
                .iter()
                .map(|(code, meaning)| format!("{code} ({meaning})"))
                .collect();
            writeln!(page, "- one of: {}", values.join(", "))?;
        }
    }
    writeln!(page, "- default: {}{unit}", row.default)?;
    if row.takes_effect == TakesEffect::AfterReboot {
        writeln!(page, "- takes effect after a restart")?;
    }
    Ok(())
}

/// The file `docs/apm.pdef.xml`, in the format of ArduPilot's parameter metadata.
pub fn apm_pdef_xml() -> String {
    let mut xml = String::from(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n\
         <!-- Written by cargo run --example parameter_docs -->\n\
         <paramfile>\n  <vehicles>\n    <parameters name=\"Rover\">\n",
    );
    for row in &TABLE {
        write_param(&mut xml, row).expect("a string takes everything");
    }
    xml.push_str("    </parameters>\n  </vehicles>\n  <libraries/>\n</paramfile>\n");
    xml
}

fn write_param(xml: &mut String, row: &Parameter) -> std::fmt::Result {
    writeln!(
        xml,
        "      <param humanName=\"{}\" name=\"Rover:{}\" documentation=\"{}\" user=\"Standard\">",
        escape(row.label),
        row.name,
        escape(row.description)
    )?;
    match row.range {
        Range::Between(lowest, highest) => {
            writeln!(xml, "        <field name=\"Range\">{lowest} {highest}</field>")?;
            writeln!(xml, "        <field name=\"Increment\">{}</field>", row.step)?;
        }
        Range::OneOf(values) => {
            writeln!(xml, "        <values>")?;
            for (code, meaning) in values {
                writeln!(
                    xml,
                    "          <value code=\"{code}\">{}</value>",
                    escape(meaning)
                )?;
            }
            writeln!(xml, "        </values>")?;
        }
    }
    if !row.unit.is_empty() {
        writeln!(xml, "        <field name=\"Units\">{}</field>", escape(row.unit))?;
    }
    if row.takes_effect == TakesEffect::AfterReboot {
        writeln!(xml, "        <field name=\"RebootRequired\">True</field>")?;
    }
    writeln!(xml, "      </param>")
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
    fn text_for_attributes_is_escaped() {
        assert_eq!(escape("a < b & \"c\""), "a &lt; b &amp; &quot;c&quot;");
    }
}
