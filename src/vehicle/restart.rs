//! What a requested restart leads to.

/// The program that runs after a requested restart. Of several requests the greatest counts: Mission Planner's "Force
/// Bootloader" requests the boot loader and then the firmware.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Restart {
    /// The firmware.
    #[default]
    Firmware,
    /// The firmware, by way of a provoked processor fault: a test of the crash record.
    Fault,
    /// The chip's own boot loader, which takes another firmware by USB.
    BootLoader,
}
