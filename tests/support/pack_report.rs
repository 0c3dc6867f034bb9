//! BATTERY_STATUS as a companion computer sends it.

use super::frames::{BATTERY_INFO, BATTERY_STATUS, BATTERY_STATUS_V2, encode_v2_from};

/// System and component id of a companion computer of the vehicle (`MAV_COMP_ID_ONBOARD_COMPUTER`), and of another one.
pub const COMPANION: [u8; 2] = [1, 191];
pub const OTHER_COMPANION: [u8; 2] = [1, 192];

/// `BATT_MONITOR` of a pack that another component measures.
pub const EXTERNAL: f32 = 29.0;

pub const UNKNOWN_MV: u16 = u16::MAX;

/// What is reported of a pack.
#[derive(Clone)]
pub struct PackReport {
    pub instance: u8,
    pub voltages_mv: [u16; 10],
    pub current_ca: i16,
    pub consumed_mah: i32,
    pub energy_hj: i32,
    pub remaining_pct: i8,
    pub temperature_cdegc: i16,
    pub time_remaining_s: i32,
    pub charge_state: u8,
    /// MAV_BATTERY_MODE
    pub mode: u8,
    pub fault_bitmask: u32,
}

impl PackReport {
    /// The voltage alone.
    pub fn of_voltage(instance: u8, voltage_mv: u16) -> Self {
        let mut voltages_mv = [UNKNOWN_MV; 10];
        voltages_mv[0] = voltage_mv;
        Self {
            instance,
            voltages_mv,
            current_ca: -1,
            consumed_mah: -1,
            energy_hj: -1,
            remaining_pct: -1,
            temperature_cdegc: i16::MAX,
            time_remaining_s: 0,
            charge_state: 0,
            mode: 0,
            fault_bitmask: 0,
        }
    }

    /// Of a companion computer.
    pub fn frame(&self) -> Vec<u8> {
        self.frame_from(COMPANION)
    }

    pub fn frame_from(&self, sender: [u8; 2]) -> Vec<u8> {
        let mut payload = Vec::new();
        payload.extend(self.consumed_mah.to_le_bytes());
        payload.extend(self.energy_hj.to_le_bytes());
        payload.extend(self.temperature_cdegc.to_le_bytes());
        payload.extend(self.voltages_mv.iter().flat_map(|mv| mv.to_le_bytes()));
        payload.extend(self.current_ca.to_le_bytes());
        // Function ALL, type LIPO.
        payload.extend([self.instance, 1, 1, self.remaining_pct as u8]);
        payload.extend(self.time_remaining_s.to_le_bytes());
        payload.push(self.charge_state);
        // No further cells.
        payload.extend([0; 4 * 2]);
        payload.push(self.mode);
        payload.extend(self.fault_bitmask.to_le_bytes());
        encode_v2_from(sender, BATTERY_STATUS, &payload)
    }
}

/// BATTERY_STATUS_V2 of a companion computer: volts, amperes, percent and flags; consumption and temperature are unknown.
pub fn report_v2(instance: u8, numbers: [f32; 3], status_flags: u32) -> Vec<u8> {
    let [voltage_v, current_a, percent] = numbers;
    let mut payload = Vec::new();
    for number in [voltage_v, current_a, f32::NAN, f32::NAN, percent] {
        payload.extend(number.to_le_bytes());
    }
    payload.extend(status_flags.to_le_bytes());
    payload.extend(i16::MAX.to_le_bytes());
    payload.push(instance);
    encode_v2_from(COMPANION, BATTERY_STATUS_V2, &payload)
}

/// BATTERY_INFO of a companion computer, with these fields alone.
pub fn health_report(sender: [u8; 2], instance: u8, cycle_count: u16, health_pct: u8) -> Vec<u8> {
    let mut payload = vec![0; 140];
    payload[40..42].copy_from_slice(&cycle_count.to_le_bytes());
    (payload[44], payload[47]) = (instance, health_pct);
    encode_v2_from(sender, BATTERY_INFO, &payload)
}
