//! Message signing: who may command the vehicle, and proof that it is the vehicle that reports.
//!
//! A signed frame carries 13 more bytes: a number for the link, a [`Timestamp`] that only ever grows, and the start of the
//! SHA-256 of a shared [`SigningKey`] and everything before (MAVLink's message signing, version 1). A receiver of such a
//! frame can't make another one, and sending it once more does not work either.
//!
//! While there is no key, everything is accepted and nothing is signed.

mod key;
mod permission;
mod stored;
mod streams;
mod time;

use core::{fmt, mem};

pub use key::SigningKey;
pub use permission::{AcceptUnsigned, Access, LinkKind};
pub(super) use permission::{Authenticity, Effect, is_permitted};
pub use stored::StoredSigning;
pub(super) use streams::Role;
pub use time::Timestamp;

use streams::{StreamId, Streams};
use time::{Mark, SigningClock, lower_mark, next_mark};

use super::parser::{ReceivedFrame, TRAILER_BYTES};
use crate::announce::{Announce, Severity};
use crate::time::Instant;

const LINK_BYTES: usize = 1;

/// Frames that are known when they come twice.
const LATEST_FRAMES: usize = 16;

const _: () = assert!(TRAILER_BYTES == LINK_BYTES + time::BYTES + key::SIGNATURE_BYTES);

/// State of signing: the key, the time, and the senders heard.
#[derive(Clone, Debug)]
pub struct Signing {
    protection: Protection,
    clock: SigningClock,
    streams: Streams,
    /// The sender of the frame that was judged last, if it was signed with our key and not overtaken.
    sender: Option<StreamId>,
    /// System and component id of the frame that was judged last, if it was overtaken.
    overtaken: Option<[u8; 2]>,
    /// From the signatures of the latest frames that were signed with our key, beginning with the last one.
    latest: [u32; LATEST_FRAMES],
    /// Our time when the rover was armed last, and when it last came to Manual: an overtaken frame from before does not stop it.
    armed_at: Timestamp,
    manual_at: Timestamp,
    /// The last sender that was reported for frames that are too old, until a new one of it comes.
    reported_old: Option<StreamId>,
    in_flash: InFlash,
    /// Nothing up to now was signed after this time, as far as the flash knows.
    stored_mark: Mark,
}

/// Permissions of senders.
#[derive(Clone, Debug)]
enum Protection {
    /// No key: everything is accepted.
    Off,
    Key(SigningKey),
    /// There was a key, and it can't be read any more. No sender has the right one until another is set up.
    KeyLost,
}

/// State that a restart would find in flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum InFlash {
    /// State in force.
    Current,
    /// Another key, or this one without its second record. It counts until the choice is written: a power cut leaves
    /// either key.
    OtherKey,
    /// That there is no key. It has to go before a key is written: half a key must not leave the vehicle open.
    NoKey,
    /// Nothing yet: a power cut leaves a lost key.
    Nothing,
    /// Something that can't be read, or what could not be written: a lost key.
    Unreadable,
}

/// Something that has to be written to flash.
#[derive(Clone, Debug, PartialEq)]
pub enum ToStore {
    /// Nothing, in place of whatever is there. Until a choice follows, this counts as a lost key.
    Nothing,
    /// Another key.
    Key(SigningKey),
    /// That there is no key any more.
    NoKey,
    /// A later time.
    Mark(Mark),
}

/// Trouble with the key, for ground stations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum SigningTrouble {
    /// There was a key that can't be read any more.
    KeyLost,
    /// A new key could not be written to flash.
    NotSaved,
}

impl Announce for SigningTrouble {
    fn severity(&self) -> Severity {
        Severity::Critical
    }
}

impl fmt::Display for SigningTrouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::KeyLost => "Signing key lost: set up by USB (used Pico: erase)",
            Self::NotSaved => "Signing not saved: set it up again after a restart",
        })
    }
}

impl Signing {
    /// Without a key.
    pub fn off() -> Self {
        Self::new(Protection::Off, InFlash::Current, Mark::default())
    }

    fn new(protection: Protection, in_flash: InFlash, mark: Mark) -> Self {
        Self {
            protection,
            clock: SigningClock::starting_at(mark.time()),
            streams: Streams::after(mark.time()),
            sender: None,
            overtaken: None,
            latest: [0; LATEST_FRAMES],
            armed_at: Timestamp::default(),
            manual_at: Timestamp::default(),
            reported_old: None,
            in_flash,
            stored_mark: mark,
        }
    }

    /// Whether there was a key that can't be read any more.
    pub fn has_lost_key(&self) -> bool {
        matches!(self.protection, Protection::KeyLost)
    }

    /// Trouble for every ground station, one that connects later too.
    pub fn trouble(&self) -> Option<SigningTrouble> {
        match (&self.protection, self.in_flash) {
            (Protection::KeyLost, _) => Some(SigningTrouble::KeyLost),
            (_, InFlash::Unreadable) => Some(SigningTrouble::NotSaved),
            _ => None,
        }
    }

    /// Takes another key, or none any more. The time goes on from `time` if that is later than ours: it never goes back,
    /// so nothing that was signed before, with any key, is accepted again. Only from the end of time, where no sender is obeyed, a
    /// new key takes it back.
    pub(super) fn set_up(&mut self, key: Option<SigningKey>, time: Timestamp, now: Instant) {
        let is_new = match (&key, &self.protection) {
            (None, _) => false,
            (Some(key), Protection::Key(before)) => key != before,
            (Some(_), Protection::Off | Protection::KeyLost) => true,
        };
        let before = mem::replace(&mut self.protection, key.map_or(Protection::Off, Protection::Key));
        self.in_flash = match (self.in_flash, before) {
            (InFlash::Current, Protection::Off) => InFlash::NoKey,
            (InFlash::Current, Protection::Key(_)) => InFlash::OtherKey,
            (in_flash, _) => in_flash,
        };
        if is_new && !self.clock.time_at(now).leaves_a_year() {
            self.clock = SigningClock::starting_at(Timestamp::default());
            self.streams.forget(time);
            (self.armed_at, self.manual_at) = (time, time);
        }
        self.clock.follow(time, now);
    }

    /// Judges who sent a frame.
    pub(super) fn check(&mut self, frame: &ReceivedFrame<'_>, now: Instant) -> Authenticity {
        (self.sender, self.overtaken) = (None, None);
        let key = match &self.protection {
            Protection::Off => return Authenticity::Unprotected,
            Protection::KeyLost => return Authenticity::Unproven,
            Protection::Key(key) => key,
        };
        let Some((signed, signature)) = frame.signed.and_then(|bytes| bytes.split_last_chunk()) else {
            return Authenticity::Unproven;
        };
        // The timestamp ends what is signed.
        let Some((before_time, time)) = signed.split_last_chunk() else {
            return Authenticity::Unproven;
        };
        let time = Timestamp::from_bytes(*time);
        let link = before_time.last().copied().unwrap_or_default();
        let stream = StreamId::new(frame.system_id, frame.component_id, link);
        if !time.leaves_a_year() || key.signature(signed) != *signature {
            return Authenticity::Unproven;
        }
        // This has an effect, so it comes after what proves who asks for it.
        let authenticity = self.streams.hear(stream, time, self.clock.time_at(now), now);
        let is_repeated = self.is_repeated(*signature);
        if let Authenticity::Overtaken { may_disarm, may_hold } = authenticity {
            if is_repeated {
                return Authenticity::Repeated;
            }
            self.overtaken = Some([frame.system_id, frame.component_id]);
            return Authenticity::Overtaken {
                may_disarm: may_disarm && time > self.armed_at,
                may_hold: may_hold && time > self.manual_at,
            };
        }
        self.sender = Some(stream);
        if authenticity == Authenticity::Proven {
            self.reported_old.take_if(|reported| *reported == stream);
            self.clock.follow(time, now);
        }
        authenticity
    }

    /// Whether the frame with this signature is one of the latest. From now on it is the last one.
    fn is_repeated(&mut self, [a, b, c, d, ..]: [u8; key::SIGNATURE_BYTES]) -> bool {
        let frame = u32::from_le_bytes([a, b, c, d]);
        let mut later = frame;
        for place in &mut self.latest {
            let known = mem::replace(place, later);
            if known == frame {
                return true;
            }
            later = known;
        }
        false
    }

    /// System and component id of the frame that was judged last, if another station with the same ids has overtaken it.
    pub(crate) fn overtaken(&self) -> Option<[u8; 2]> {
        self.overtaken
    }

    /// The rover was armed.
    pub(super) fn mark_armed(&mut self, now: Instant) {
        self.armed_at = self.clock.time_at(now);
    }

    /// The mode has become Manual.
    pub(super) fn mark_manual(&mut self, now: Instant) {
        self.manual_at = self.clock.time_at(now);
    }

    /// The sender of the frame that was judged last is not forgotten while it has this role.
    pub(super) fn keep_sender(&mut self, role: Role) {
        if let Some(sender) = self.sender {
            self.streams.keep(sender, role);
        }
    }

    /// Whether it has to be reported that the frame that was judged last is too old: once, until its sender is fresh again.
    pub(crate) fn reports_old(&mut self) -> bool {
        let is_first = self.reported_old != self.sender;
        self.reported_old = self.sender;
        is_first
    }

    /// Whether frames leave signed.
    pub(super) fn signs(&self) -> bool {
        matches!(self.protection, Protection::Key(_))
    }

    /// Whether what only reads is answered without a signature where this much is accepted without one.
    pub fn permits_unsigned_reads(&self, accepted: AcceptUnsigned) -> bool {
        let authenticity = match self.protection {
            Protection::Off => Authenticity::Unprotected,
            Protection::Key(_) | Protection::KeyLost => Authenticity::Unproven,
        };
        is_permitted(Effect::Reads, authenticity, accepted)
    }

    /// Fills in the last [`TRAILER_BYTES`] of a frame whose header says that it is signed.
    pub(super) fn sign(&mut self, frame: &mut [u8], link: LinkKind, now: Instant) {
        let Protection::Key(key) = &self.protection else {
            return;
        };
        let Some((before, signature)) = frame.split_last_chunk_mut() else {
            return;
        };
        if let Some((before_time, time)) = before.split_last_chunk_mut() {
            *time = self.clock.next(now).to_bytes();
            if let Some(number) = before_time.last_mut() {
                *number = link.number();
            }
        }
        *signature = key.signature(before);
    }

    /// The next write to flash, if there is one. The vehicle has been armed for
    /// `armed_us`, 0 if it is not.
    pub fn next_unsaved(&self, now: Instant, armed_us: u64) -> Option<ToStore> {
        let key = match &self.protection {
            Protection::KeyLost => return None,
            Protection::Off => None,
            Protection::Key(key) => Some(key),
        };
        let mark = || next_mark(self.stored_mark, self.clock.time_at(now), armed_us).map(ToStore::Mark);
        match (self.in_flash, key) {
            (InFlash::Current, None) => None,
            (InFlash::Current, Some(_)) => mark().or_else(|| {
                lower_mark(self.stored_mark, self.clock.time_at(now), armed_us).map(ToStore::Mark)
            }),
            // The mark comes first: the flash should not be behind the frames that leave. A lower one comes last: no power cut
            // lets the older key's frames count again.
            (InFlash::OtherKey | InFlash::Nothing, Some(key)) => {
                mark().or_else(|| Some(ToStore::Key(key.clone())))
            }
            (InFlash::OtherKey | InFlash::Nothing | InFlash::NoKey, None) => Some(ToStore::NoKey),
            (InFlash::NoKey, Some(_)) | (InFlash::Unreadable, _) => Some(ToStore::Nothing),
        }
    }

    /// Whether another key, or that there is none any more, is not in flash yet.
    pub fn is_key_unsaved(&self) -> bool {
        !matches!(self.protection, Protection::KeyLost) && self.in_flash != InFlash::Current
    }

    /// This is in flash now. If another key was set up in the meantime, that one still has to be written.
    pub fn mark_saved(&mut self, saved: &ToStore) {
        self.in_flash = match (saved, &self.protection) {
            (ToStore::Nothing, _) => {
                self.stored_mark = Mark::default();
                InFlash::Nothing
            }
            (ToStore::Mark(mark), _) => {
                self.stored_mark = *mark;
                return;
            }
            (ToStore::Key(saved), Protection::Key(key)) if saved == key => InFlash::Current,
            (ToStore::NoKey, Protection::Off) => InFlash::Current,
            (ToStore::Key(_), _) => InFlash::OtherKey,
            (ToStore::NoKey, _) => InFlash::NoKey,
        };
    }

    /// Something could not be written to flash. What is there is not to be relied on any more.
    pub fn mark_failed(&mut self) {
        self.in_flash = InFlash::Unreadable;
    }
}

#[cfg(test)]
mod tests {
    use super::super::parser::FrameParser;
    use super::*;
    use crate::time::at_us;

    /// Signed by pymavlink 2.4.50 with the key 1, 2, … 32 as link 7 at 0x0123456789ab: a HEARTBEAT of system 255,
    /// component 190.
    const HEARTBEAT: [u8; 34] = [
        0xfd, 0x09, 0x01, 0x00, 0x00, 0xff, 0xbe, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x06, 0x08, 0xc0,
        0x04, 0x03, 0x03, 0x8b, 0x07, 0xab, 0x89, 0x67, 0x45, 0x23, 0x01, 0xb6, 0x99, 0x4d, 0x54, 0xd3, 0x35,
    ];

    fn key() -> SigningKey {
        SigningKey::new(core::array::from_fn(|index| index as u8 + 1)).unwrap()
    }

    fn with_key() -> Signing {
        Signing::new(Protection::Key(key()), InFlash::Current, Mark::default())
    }

    fn check(signing: &mut Signing, bytes: &[u8]) -> Authenticity {
        let mut parser = FrameParser::new();
        parser.push(bytes);
        signing.check(&parser.next_frame().expect("a frame"), Instant::EPOCH)
    }

    #[test]
    fn a_frame_that_pymavlink_has_signed_is_accepted_once() {
        let mut signing = with_key();
        assert_eq!(check(&mut signing, &HEARTBEAT), Authenticity::Proven);
        assert_eq!(check(&mut signing, &HEARTBEAT), Authenticity::Repeated);
        assert_eq!(
            signing.clock.time_at(Instant::EPOCH).ticks(),
            0x0123_4567_89ab,
            "we follow"
        );
    }

    #[test]
    fn every_single_bit_of_it_counts() {
        for bit in 8 * (HEARTBEAT.len() - TRAILER_BYTES)..8 * HEARTBEAT.len() {
            let mut bytes = HEARTBEAT;
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(
                check(&mut with_key(), &bytes),
                Authenticity::Unproven,
                "bit {bit}"
            );
        }
    }

    #[test]
    fn we_sign_as_pymavlink_does() {
        let mut signing = with_key();
        signing
            .clock
            .follow(Timestamp::from_ticks(0x0123_4567_89aa).unwrap(), Instant::EPOCH);
        let mut bytes = HEARTBEAT;
        bytes[HEARTBEAT.len() - TRAILER_BYTES..].fill(0);
        signing.sign(&mut bytes, LinkKind::Radio, at_us(10));
        // Everything but the link's number, and what follows from that.
        assert_eq!(bytes[..21], HEARTBEAT[..21]);
        assert_eq!(bytes[21], 0);
        assert_eq!(bytes[22..28], HEARTBEAT[22..28]);
        let mut receiver = with_key();
        assert_eq!(check(&mut receiver, &bytes), Authenticity::Proven);
        // The next frame has a later time, even if it leaves at once.
        signing.sign(&mut bytes, LinkKind::Radio, at_us(10));
        assert_eq!(check(&mut receiver, &bytes), Authenticity::Proven);
    }

    #[test]
    fn no_two_frames_have_the_same_time_and_it_never_goes_back() {
        let mut clock = SigningClock::starting_at(Timestamp::from_ticks(1000).unwrap());
        let times = [0, 0, 0, 5, 100, 100].map(|us| clock.next(at_us(us)).ticks());
        assert_eq!(times, [1001, 1002, 1003, 1004, 1010, 1011]);
        clock.follow(Timestamp::from_ticks(500).unwrap(), at_us(100));
        assert_eq!(clock.next(at_us(100)).ticks(), 1012);
        clock.follow(Timestamp::from_ticks(90_000).unwrap(), at_us(200));
        assert_eq!(clock.next(at_us(200)).ticks(), 90_000);
        assert_eq!(clock.next(at_us(300)).ticks(), 90_010);
    }

    /// The latest time that a frame may have.
    const LATEST_TICKS: u64 = (1 << 48) - 1 - 365 * 86_400 * Timestamp::PER_SECOND;

    fn time(ticks: u64) -> Timestamp {
        Timestamp::from_ticks(ticks).expect("48 bits")
    }

    #[test]
    fn at_the_end_of_time_nothing_overflows() {
        let end = time((1 << 48) - 1);
        assert_eq!(Timestamp::from_ticks(1 << 48), None);
        let mut clock = SigningClock::starting_at(end);
        assert_eq!((clock.next(Instant::MAX), clock.next(Instant::MAX)), (end, end));
        assert_eq!(
            next_mark(Mark::default(), end, 0).map(|mark| mark.time()),
            Some(end)
        );
    }

    #[test]
    fn at_the_end_of_time_a_frame_does_nothing_and_is_not_remembered() {
        for (ticks, is_followed) in [
            (LATEST_TICKS, true),
            (LATEST_TICKS + 1, false),
            ((1 << 48) - 1, false),
        ] {
            let mut signing = with_key();
            let authenticity = check(&mut signing, &signed(&key(), 0, ticks));
            assert_eq!(authenticity == Authenticity::Proven, is_followed, "{ticks}");
            let shown = signing.clock.time_at(Instant::EPOCH).ticks();
            assert_eq!(shown, if is_followed { ticks } else { 0 });
            if !is_followed {
                let authenticity = check(&mut signing, &signed(&key(), 0, 1));
                assert_eq!(authenticity, Authenticity::Proven);
            }
        }
    }

    /// A HEARTBEAT signed with this key.
    fn signed(key: &SigningKey, link: u8, ticks: u64) -> [u8; 34] {
        let mut frame = HEARTBEAT;
        let signature_at = frame.len() - key::SIGNATURE_BYTES;
        frame[signature_at - time::BYTES..signature_at].copy_from_slice(&time(ticks).to_bytes());
        frame[signature_at - time::BYTES - 1] = link;
        let signature = key.signature(&frame[..signature_at]);
        frame[signature_at..].copy_from_slice(&signature);
        frame
    }

    #[test]
    fn only_from_the_end_of_time_and_by_a_new_key_does_the_time_go_back() {
        let other = SigningKey::new([9; 32]).unwrap();
        let (locked, free) = (LATEST_TICKS + 1, LATEST_TICKS - 2);
        for (before, set_up, ticks, goes_back) in [
            (Protection::Key(key()), Some(other.clone()), locked, true),
            (Protection::Off, Some(other.clone()), locked, true),
            (Protection::KeyLost, Some(other.clone()), locked, true),
            (Protection::Key(key()), Some(key()), locked, false),
            (Protection::Key(key()), None, locked, false),
            (Protection::Key(key()), Some(other.clone()), free, false),
            (Protection::Off, Some(other.clone()), free, false),
        ] {
            let mut signing = Signing::new(before, InFlash::Current, Mark::default());
            signing.clock = SigningClock::starting_at(time(ticks));
            signing.streams = Streams::after(time(ticks));
            signing.set_up(set_up.clone(), time(5_000), at_us(20));
            let shown = signing.clock.time_at(at_us(20)).ticks();
            let expected = if goes_back { 5_000 } else { ticks + 2 };
            assert_eq!(shown, expected, "{set_up:?} at {ticks}");
            if let Some(key) = set_up {
                let authenticity = check(&mut signing, &signed(&key, 0, 5_001));
                assert_eq!(authenticity == Authenticity::Proven, goes_back, "at {ticks}");
            }
        }
    }

    fn sender(link: u8) -> StreamId {
        StreamId::new(255, 190, link)
    }

    #[test]
    fn a_seventeenth_sender_is_heard_and_none_is_heard_twice() {
        let ours = time(5_000);
        let mut streams = Streams::after(Timestamp::default());
        let hear = |streams: &mut Streams, link, ticks| {
            streams.hear(sender(link), time(ticks), ours, Instant::EPOCH)
        };
        for link in 0..17 {
            let authenticity = hear(&mut streams, link, 1000 + u64::from(link));
            assert_eq!(authenticity, Authenticity::Proven);
        }
        for link in 0..17 {
            for ticks in [1, 1000, 1000 + u64::from(link)] {
                let authenticity = hear(&mut streams, link, ticks);
                assert_ne!(authenticity, Authenticity::Proven, "{link} at {ticks}");
            }
        }
        let authenticity = hear(&mut streams, 0, 2000);
        assert_eq!(authenticity, Authenticity::Proven, "the one that was forgotten");
    }

    #[test]
    fn the_sender_heard_longest_ago_is_forgotten_whatever_its_time() {
        let ours = time(5_000);
        let mut streams = Streams::after(Timestamp::default());
        // The later we hear them, the older their times are.
        for link in 0..16 {
            let now = at_us(u64::from(link) << 16);
            streams.hear(sender(link), time(1100 - u64::from(link)), ours, now);
        }
        // The first one is heard again.
        streams.hear(sender(0), time(1101), ours, at_us(16 << 16));
        streams.hear(sender(16), time(2000), ours, at_us(17 << 16));
        let much_later = time(100_000_000);
        for link in 0..17 {
            let authenticity = streams.hear(sender(link), time(3000), much_later, at_us(18 << 16));
            let expected = if link == 1 {
                Authenticity::TooOld
            } else {
                Authenticity::Late
            };
            assert_eq!(authenticity, expected, "{link}");
        }
    }

    #[test]
    fn a_sender_may_be_a_minute_behind_and_no_more_unless_it_is_known() {
        let ours = time(100_000_000);
        let mut streams = Streams::after(Timestamp::default());
        let mut hear = |ticks, ours| streams.hear(sender(0), time(ticks), ours, Instant::EPOCH);
        assert_eq!(hear(93_999_999, ours), Authenticity::TooOld);
        assert_eq!(hear(94_000_000, ours), Authenticity::Proven);
        // Recorded while it was jammed, and held back.
        assert_eq!(hear(94_000_001, ours.later(2)), Authenticity::Late);
        for (later, is_recent) in [(1, true), (2, false)] {
            let overtaken = Authenticity::Overtaken {
                may_disarm: is_recent,
                may_hold: is_recent,
            };
            assert_eq!(hear(94_000_001, ours.later(later)), overtaken);
        }
        assert_eq!(hear(94_000_002, ours.later(2)), Authenticity::Proven);
    }

    #[test]
    fn a_key_that_is_set_up_while_another_is_written_is_written_too() {
        let mut signing = with_key();
        let other = SigningKey::new([9; 32]).unwrap();
        for key in [key(), other.clone()] {
            signing.set_up(Some(key), Timestamp::default(), Instant::EPOCH);
        }
        signing.mark_saved(&ToStore::Key(key()));
        signing.mark_saved(&ToStore::NoKey);
        assert!(signing.is_key_unsaved());
        signing.mark_saved(&ToStore::Key(other));
        assert!(!signing.is_key_unsaved());
    }

    #[test]
    fn a_key_is_not_shown() {
        assert_eq!(format!("{:?}", key()), "SigningKey");
    }
}
