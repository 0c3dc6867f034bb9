//! Learnt properties of a pack, and whether flash holds them.

use crate::event::{PackEvents, push};
use crate::settings::PackSettings;
use crate::{LearntPack, MeasuringScale, PackEvent};

/// A new cell has up to so much more than its label says, relative to it; more is a wrong scale or label.
const MAX_ABOVE_LABEL: f32 = 1.1;

/// Standard deviations by which it has to be above the label.
const SURE_SIGMAS: f32 = 2.0;

/// Learnt properties of the pack, once flash was read.
#[derive(Clone, Copy, Debug)]
pub struct Learnt {
    pack: LearntPack,
    standing: Standing,
}

/// State of the learnt properties relative to flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Standing {
    /// Flash holds them.
    Saved,
    /// They have to be written.
    Unsaved,
    /// The pack was swapped, or charged elsewhere. What is kept is hidden until this one has the same resistance, or is learnt.
    Swapped,
    /// By its serial number this is another pack. What is kept is hidden until it is learnt.
    Replaced,
}

impl Learnt {
    /// As flash holds it.
    pub fn saved(pack: LearntPack) -> Self {
        Self {
            pack,
            standing: Standing::Saved,
        }
    }

    pub fn pack(&self) -> &LearntPack {
        &self.pack
    }

    /// The record to write to flash.
    pub fn unsaved(&self) -> Option<&LearntPack> {
        (self.standing == Standing::Unsaved).then_some(&self.pack)
    }

    /// `saved` is in flash now.
    pub fn mark_saved(&mut self, saved: &LearntPack) {
        if self.pack.to_words() == saved.to_words() {
            self.standing = Standing::Saved;
        }
    }

    /// Erases it.
    pub fn erase(&mut self) {
        self.pack = LearntPack::of(self.pack.serial_number);
        self.standing = Standing::Unsaved;
    }

    /// The pack was swapped. A serial number that is set says which one it is: what was learnt of it stays.
    pub fn swap(&mut self, set_serial_number: Option<i32>) {
        self.clear_charge();
        if set_serial_number.is_none() && self.pack.learnt().is_some() {
            self.standing = Standing::Swapped;
        }
    }

    /// The pack reports another serial number.
    pub fn replace_pack(&mut self) {
        self.clear_charge();
        self.standing = Standing::Replaced;
    }

    /// Takes the resistance of a cell of this pack, in ohms.
    pub fn compare(&mut self, cell_ohm: f32) {
        if self.standing == Standing::Swapped && self.pack.has_resistance(cell_ohm) {
            self.standing = Standing::Unsaved;
        }
    }

    /// The kept charge is that of another pack, or of this one before it was charged.
    pub fn clear_charge(&mut self) {
        self.pack = self.pack.without_charge().without_open_lesson();
    }

    /// Converts knowledge under another scale to this one.
    pub fn follow_scale(&mut self, scale: &MeasuringScale) {
        if let Some(rescaled) = self.pack.rescaled(scale) {
            self.pack = rescaled;
        }
    }

    /// A kept lesson whose current was made of another source does not go on.
    pub fn follow_current(&mut self, current_source: u16) {
        if self
            .pack
            .open
            .is_some_and(|open| open.current_source != current_source)
        {
            self.pack = self.pack.without_open_lesson();
        }
    }

    /// Learnt properties of the pack, unless the settings say that it is another one.
    pub fn known(&self, settings: &PackSettings, cell_count: Option<u8>) -> Option<&LearntPack> {
        self.shown()
            .filter(|pack| pack.matches(settings.chemistry, cell_count, settings.capacity_mah))
    }

    /// The kept knowledge, unless that may be of another pack.
    pub fn shown(&self) -> Option<&LearntPack> {
        match self.standing {
            Standing::Saved | Standing::Unsaved => Some(&self.pack),
            Standing::Swapped | Standing::Replaced => None,
        }
    }

    /// The knowledge of the pack, as [`known`](Self::known); a record without any if there is none.
    pub fn of<'a>(
        learnt: Option<&'a Self>,
        settings: &PackSettings,
        cell_count: Option<u8>,
    ) -> &'a LearntPack {
        /// Nothing is known of a pack.
        static UNKNOWN: LearntPack = LearntPack::UNKNOWN;
        learnt
            .and_then(|learnt| learnt.known(settings, cell_count))
            .unwrap_or(&UNKNOWN)
    }

    /// Takes over what was learnt of the pack or of its rest. Announces the first time, and a capacity that no such pack has.
    pub fn update(
        &mut self,
        kept: &LearntPack,
        settings: &PackSettings,
        cell_count: Option<u8>,
        events: &mut PackEvents,
    ) {
        let is_above_label = |pack: &LearntPack| {
            let learnt = pack.learnt().and(pack.capacity());
            learnt
                .zip(settings.capacity_mah)
                .is_some_and(|(learnt, label_mah)| {
                    let least_mah = learnt.capacity_mah * (1.0 - SURE_SIGMAS * learnt.sigma);
                    learnt.capacity_mah > MAX_ABOVE_LABEL * label_mah && least_mah > label_mah
                })
        };
        let known = self.known(settings, cell_count);
        let was_learnt = known.is_some_and(|known| known.learnt().is_some());
        let was_above = known.is_some_and(is_above_label);
        match known {
            Some(_) => self.persist(kept),
            None => self.replace(kept),
        }
        let Some((capacity_mah, resistance_ohm)) = kept.learnt() else {
            return;
        };
        if !was_learnt {
            let event = PackEvent::Learnt {
                capacity_mah,
                resistance_ohm,
            };
            push(events, event);
        }
        if is_above_label(kept) && !was_above {
            push(events, PackEvent::CapacityAboveLabel(settings.current_scale));
        }
    }

    /// Takes over what was learnt in addition. Flash is spared what it holds already.
    fn persist(&mut self, kept: &LearntPack) {
        let kept = LearntPack {
            serial_number: self.pack.serial_number,
            scale: self.pack.scale,
            ..*kept
        };
        if kept.is_like(&self.pack) {
            return;
        }
        self.pack = kept;
        self.standing = Standing::Unsaved;
    }

    /// Takes over what was learnt of a pack with other settings. Those may be a mistake: until the pack is learnt, what
    /// is known of the one before stays.
    fn replace(&mut self, kept: &LearntPack) {
        if kept.learnt().is_some() || self.pack.learnt().is_none() {
            self.persist(kept);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learnt::{LearntCapacity, LearntResistance};

    #[test]
    // Requirement: PX-6
    fn a_capacity_above_the_label_is_announced_once_it_is_sure() {
        let settings = PackSettings {
            capacity_mah: Some(2200.0),
            ..PackSettings::default()
        };
        let mut learnt = Learnt::saved(LearntPack::UNKNOWN);
        for (capacity_mah, sigma, expected) in [
            (2440.0, 0.06, 0),
            (2600.0, 0.08, 0),
            (2600.0, 0.03, 1),
            (2610.0, 0.03, 0),
            (2400.0, 0.0, 0),
            (2421.0, 0.0, 1),
        ] {
            let kept = LearntPack {
                cell_count: 3,
                capacity: Some(LearntCapacity {
                    capacity_mah,
                    sigma,
                    seen_mah: 0.0,
                    seen_sigma: 0.0,
                }),
                resistance: Some(LearntResistance {
                    now_ohm: 0.03,
                    first_ohm: 0.03,
                }),
                ..LearntPack::UNKNOWN
            };
            let mut events = PackEvents::new();
            learnt.update(&kept, &settings, Some(3), &mut events);
            let is_check = |event: &&PackEvent| matches!(event, PackEvent::CapacityAboveLabel(_));
            let count = events.iter().filter(is_check).count();
            assert_eq!(count, expected, "{capacity_mah} {sigma}");
        }
    }
}
