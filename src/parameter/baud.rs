//! ArduPilot's coding of baud rates.

/// Baud rate of a `SERIAL0_BAUD` code: thousands, rounded.
pub fn serial_baud(code: i32) -> u32 {
    match code {
        9 => 9_600,
        19 => 19_200,
        38 => 38_400,
        57 => 57_600,
        111 => 111_100,
        230 => 230_400,
        256 => 256_000,
        460 => 460_800,
        500 => 500_000,
        921 => 921_600,
        // The default, also for an invalid code.
        _ => 115_200,
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Range, VehicleParameter};
    use super::*;

    #[test]
    fn every_code_has_its_documented_rate() {
        let Range::OneOf(codes) = VehicleParameter::Serial0Baud.row().range else {
            panic!("a list of codes");
        };
        for (code, rate) in codes {
            assert_eq!(serial_baud(*code).to_string(), rate.text());
        }
    }
}
