//! Work that a call leaves for other tasks.

use bitflags::bitflags;

bitflags! {
    /// What other tasks have to do after a call.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Work: u16 {
        /// The outputs may have changed: [`Autopilot::drive`](super::Autopilot::drive).
        const DRIVE = 1;
        /// Something was announced: [`Autopilot::post_due`](super::Autopilot::post_due) on every link.
        const ANNOUNCED = 1 << 1;
        /// Parameters have to be written to flash.
        const SAVE_PARAMETERS = 1 << 2;
        /// The signing key has to be written to flash.
        const SAVE_SIGNING = 1 << 3;
        /// What is learnt of the packs has to be read from flash or written to it.
        const KEEP_LEARNT = 1 << 4;
        /// A ground station requested a restart.
        const RESTART = 1 << 5;
        /// A ground station sent a HEARTBEAT.
        const GROUND_STATION_HEARD = 1 << 6;
        /// What the radio is to do may have changed: [`Autopilot::wifi_setup`](super::Autopilot::wifi_setup).
        const WIFI = 1 << 7;
        /// Names or passwords of networks have to be written to flash.
        const SAVE_WIFI = 1 << 8;
    }
}
