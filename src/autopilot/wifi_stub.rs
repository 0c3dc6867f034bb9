use super::autopilot::Autopilot;
use crate::wifi::*;
impl Autopilot {
    #[allow(missing_docs)]
    pub fn wifi_setup(&self) -> Option<WifiSetup> {
        let c = WifiChoice::from_parameters(&self.parameters);
        let password = Password::new(b"k7mf-2xqp-9drw")?;
        Some(WifiSetup { mode: c.mode, channel: c.channel, power_save: c.power_save, own_name: Ssid::of_board(self.identity.board_id), own_password: password, network: None })
    }
    #[allow(missing_docs)]
    pub fn wifi_report(&mut self, report: WifiReport) {
        crate::log::warn!("{:?}", report);
    }
}
