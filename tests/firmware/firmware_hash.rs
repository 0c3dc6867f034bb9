//! The hash of the program in flash: on the wire, in the log, and by the file that was flashed.

use std::sync::OnceLock;

use object::LittleEndian;
use object::read::elf::{ElfFile32, FileHeader, ProgramHeader};

use emulator::LogLevel;
use support::commands::REQUEST_MESSAGE;
use support::frames::{AUTOPILOT_VERSION, of_message};
use support::requests::command_long;
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, TestedVehicle};
use workbench::elf::{Artifact, build};

const FLASH_BASE: u32 = 0x1000_0000;

/// `flight_custom_version` in AUTOPILOT_VERSION.
const HASH_AT: usize = 36;
const HASH_CHARS: usize = 8;

/// Offset in flash and bytes of each part of the program, in the order of offsets.
type Parts = Vec<(u32, Vec<u8>)>;

/// As the file of the release firmware describes it.
fn parts() -> &'static Parts {
    static PARTS: OnceLock<Parts> = OnceLock::new();
    PARTS.get_or_init(|| {
        let file = std::fs::read(build(Artifact::Binary("rover-battmon"))).expect("it was built");
        let elf = ElfFile32::<LittleEndian>::parse(&*file).expect("cargo links ELF files");
        let endian = elf.elf_header().endian().expect("it has one");
        let segments = elf.elf_program_headers().iter();
        let loaded = segments.filter(|segment| segment.p_type(endian) == object::elf::PT_LOAD);
        let mut parts: Parts = loaded
            .map(|segment| (segment, segment.data(endian, &*file).expect("it is in the file")))
            .filter(|(_, bytes)| !bytes.is_empty())
            .map(|(segment, bytes)| (segment.p_paddr(endian) - FLASH_BASE, bytes.to_vec()))
            .collect();
        parts.sort();
        parts
    })
}

/// Bit by bit, as IEEE 802.3 has it.
fn crc32(bytes: impl Iterator<Item = u8>) -> u32 {
    let bits = bytes.flat_map(|byte| (0..8).map(move |bit| byte >> bit & 1));
    !bits.fold(!0, |crc, bit| {
        let is_out = (crc ^ u32::from(bit)) & 1 != 0;
        if is_out { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 }
    })
}

fn hash_of(parts: &Parts) -> String {
    let bytes = parts.iter().flat_map(|(_, bytes)| bytes.iter().copied());
    format!("{:08x}", crc32(bytes))
}

fn reported(mut bench: Bench) -> String {
    bench.run_for(500 * MILLISECOND);
    let answers = bench.ask(&command_long(REQUEST_MESSAGE, AUTOPILOT_VERSION as f32));
    of_message(&answers, AUTOPILOT_VERSION)[0].text(HASH_AT, HASH_CHARS)
}

#[test]
fn it_is_logged_soon_and_does_not_delay_the_start() {
    let mut bench = Bench::power_up(DIVIDER_CODE);
    bench.run_for(500 * MILLISECOND);
    let banner = bench.logged(LogLevel::Info, "started by")[0].0;
    let program = bench.logged(LogLevel::Info, &format!("program {}", hash_of(parts())));
    let hashed_after_us = program[0].0 - banner;
    let started_after_us = bench.uart_frames()[0].at_us - banner;
    println!("first frame after {started_after_us} us, hash after {hashed_after_us} us");
    // Meanwhile the logs are looked for.
    assert!(hashed_after_us < 450 * MILLISECOND, "{hashed_after_us} us");
    // Of these, some 2 ms are lines of flash that are read for the first time.
    assert!(started_after_us < 28 * MILLISECOND, "{started_after_us} us");
}

#[test]
fn a_single_bit_changes_it() {
    // Of a text that is sent after crashes only, and of a file that is served.
    for text in ["called from", "mftp://parameters"] {
        let mut changed = parts().clone();
        let mut places = changed.iter_mut().filter_map(|(offset, bytes)| {
            let at = bytes
                .windows(text.len())
                .position(|window| window == text.as_bytes())?;
            Some((*offset + at as u32, &mut bytes[at]))
        });
        let (offset, byte) = places.next_back().expect("the firmware has it");
        *byte ^= 1;
        let bench = Bench::power_up_with_flash(DIVIDER_CODE, offset, &[*byte]);
        assert_ne!(hash_of(&changed), hash_of(parts()));
        assert_eq!(reported(bench), hash_of(&changed), "{text}");
    }
}

#[test]
fn what_is_between_and_behind_the_parts_does_not_change_it() {
    // UF2 files fill pages of 256 bytes.
    let (last, bytes) = parts().last().expect("it has some");
    let image_bytes = last + (bytes.len() as u32).next_multiple_of(256);
    let mut image = vec![0x5a; image_bytes as usize];
    for (offset, bytes) in parts() {
        let start = *offset as usize;
        image[start..start + bytes.len()].copy_from_slice(bytes);
    }
    let bench = Bench::power_up_with_flash(DIVIDER_CODE, 0, &image);
    assert_eq!(reported(bench), hash_of(parts()));
}
