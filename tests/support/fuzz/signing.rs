//! Signing: only the key opens, and each frame once, whatever is recorded, changed and sent again, over restarts too.

use crate::signer::OWNER;
use std::collections::BTreeMap;

use rover_battmon::autopilot::{FlashJob, FlashStore, Start};
use rover_battmon::mavlink::{Event, LinkKind, StoredSigning, ToStore};
use rover_battmon::memory::storage::Condition;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, Parameters};

use super::Input;
use crate::desk::Desk;
use crate::requests::{param_set, setup_signing};
use crate::signer::Signer;

/// A protected radio link, what its flash holds, and what a stranger has recorded.
struct Scene {
    desk: Desk,
    words: BTreeMap<u16, u32>,
    owner: Signer,
    recorded: Vec<Vec<u8>>,
    set: f32,
}

impl Scene {
    fn new() -> Self {
        let mut desk = Desk::without_packs();
        let owner = Signer::new(OWNER);
        desk.connect(LinkKind::Direct);
        desk.receive_in_chunks(&setup_signing(owner.key, owner.timestamp), 64);
        desk.connect(LinkKind::Radio);
        Self {
            desk,
            words: BTreeMap::new(),
            owner,
            recorded: Vec::new(),
            set: 0.0,
        }
    }

    fn stored(&self) -> StoredSigning {
        let mut stored = StoredSigning::default();
        for (key, word) in &self.words {
            stored.found(*key, *word);
        }
        stored
    }

    /// Another request of the owner's, recorded by a stranger.
    fn sign(&mut self) -> Vec<u8> {
        self.set += 0.001;
        let frame = self.owner.sign(&param_set("BATT_LOW_VOLT", self.set));
        self.recorded.push(frame.clone());
        frame
    }

    fn recorded(&self, number: u8) -> Vec<u8> {
        let index = usize::from(number) % self.recorded.len().max(1);
        self.recorded.get(index).cloned().unwrap_or_default()
    }

    fn low_volt(&self) -> f32 {
        self.desk
            .parameters()
            .get(BatteryParameter::LowVolt.of(Pack::First))
    }

    /// Delivers what a stranger can send, and then nothing for a while.
    fn attack(&mut self, bytes: &[u8]) {
        let before = self.desk.parameters().clone();
        let mut events = self.desk.receive_in_chunks(bytes, 64);
        self.desk.endpoint.give_up_waiting();
        events.extend(self.desk.handle_all());
        for event in events {
            assert!(
                matches!(event, Event::Unauthorized { .. } | Event::TooOld | Event::Ignored),
                "{event:?}"
            );
        }
        assert!(*self.desk.parameters() == before);
    }

    fn save_now(&mut self) {
        while let Some(FlashJob::Signing(unsaved)) = self.desk.next_flash_job(FlashStore::Signing) {
            if unsaved == ToStore::Nothing {
                self.words.clear();
            }
            self.words.extend(self.stored().words(&unsaved));
            self.desk.flash_done(&FlashJob::Signing(unsaved), Ok(None));
        }
    }

    fn restart(&mut self) {
        self.save_now();
        self.desk = Desk::starting(Start {
            parameters: self.desk.parameters().clone(),
            signing: self.stored().restore(Condition::Intact),
            ..Start::with_parameters(Parameters::defaults())
        });
        self.save_now();
    }

    /// The owner's ground station hears the vehicle, and goes on from its time.
    fn hear(&mut self) {
        self.desk.post_due(self.desk.now_us);
        self.owner.hear(&self.desk.sent());
    }
}

/// Steps: a byte says what happens, the next ones how.
pub fn run(bytes: &[u8]) {
    let mut input = Input::new(bytes);
    let mut scene = Scene::new();
    while !input.is_empty() {
        match input.byte() % 8 {
            0 => {
                scene.hear();
                let frame = scene.sign();
                scene.desk.receive_in_chunks(&frame, 64);
                assert_eq!(scene.low_volt(), scene.set, "the owner is obeyed");
            }
            1 => {
                let recording = scene.recorded(input.byte());
                scene.attack(&recording);
            }
            2 => {
                // One that was never heard, changed on its way; the owner's next one is later.
                let mut frame = scene.sign();
                scene.recorded.pop();
                let at = usize::from(input.byte()) % frame.len();
                frame[at] ^= input.byte().max(1);
                scene.attack(&frame);
            }
            3 => {
                let mut recording = scene.recorded(input.byte());
                let length = recording.len().max(1);
                for _ in 0..3 {
                    let at = usize::from(input.byte()) % length;
                    if let Some(byte) = recording.get_mut(at) {
                        *byte ^= input.byte();
                    }
                }
                scene.attack(&recording);
            }
            4 => {
                let length = usize::from(input.byte());
                scene.attack(input.bytes(length));
            }
            5 => {
                scene.desk.now_us += u64::from(input.u16()) * 10_000;
                scene.save_now();
            }
            6 => scene.owner.link = input.byte() % 20,
            _ => scene.restart(),
        }
    }
}
