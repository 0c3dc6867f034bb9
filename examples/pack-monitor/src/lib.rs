//! For a part that the library does not read: a MAX17048, of which the voltage is measured.

#![no_std]

use embedded_hal_async::i2c::I2c;
use rover_battmon::battery::{BusError, Measurement, ReadError};

/// The voltage of the cell is in register 2, in steps of 78.125 µV.
pub async fn read_max17048(bus: &mut impl I2c) -> Result<Measurement, ReadError> {
    let mut code = [0; 2];
    let answer = bus.write_read(0x36u8, &[2], &mut code).await;
    answer.map_err(|_| ReadError::Bus(BusError::NoAnswer))?;
    Ok(Measurement {
        voltage_v: Some(f32::from(u16::from_be_bytes(code)) * 78.125e-6),
        // What it does not measure stays unknown.
        ..Measurement::default()
    })
}
