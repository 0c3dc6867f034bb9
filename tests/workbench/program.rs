//! The release ELF: its symbols, its sections, and which bytes are code.

use std::ops::Range;
use std::path::Path;
use std::sync::OnceLock;

use object::read::elf::ElfFile32;
use object::{LittleEndian, Object, ObjectSection, ObjectSymbol, SymbolKind};

use crate::elf::{Artifact, build};

/// Flash is mapped at 0x10000000, RAM begins at 0x20000000.
const RAM_START: u32 = 0x2000_0000;
const RAM_END: u32 = 0x2004_2000;

/// What the firmware may take of flash, of both its regions together, and of RAM but for the stack.
pub const FLASH_BUDGET_BYTES: u32 = 794 * 1024;
pub const RAM_BUDGET_BYTES: u32 = 179 * 1024;

/// A symbol that stands for something with an address.
#[derive(Clone, Debug)]
pub struct Symbol {
    /// Demangled, without the hash.
    pub name: String,
    pub address: u32,
    pub size: u32,
    pub is_function: bool,
}

/// A section that takes room in the chip.
pub struct Section {
    pub name: String,
    pub address: u32,
    pub size: u32,
    /// What of it is stored in flash; nothing of `.bss` and `.uninit`.
    pub bytes: Vec<u8>,
}

impl Section {
    pub fn is_in_ram(&self) -> bool {
        (RAM_START..RAM_END).contains(&self.address)
    }
}

/// The release firmware.
pub struct Program {
    pub file: Vec<u8>,
    pub symbols: Vec<Symbol>,
    pub sections: Vec<Section>,
    /// Where code and where data begins within code sections, by the mapping symbols `$t` and `$d`.
    marks: Vec<(u32, bool)>,
}

/// Builds the firmware, once per run.
pub fn release_firmware() -> &'static Program {
    static PROGRAM: OnceLock<Program> = OnceLock::new();
    PROGRAM.get_or_init(|| Program::load(&build(Artifact::Binary("rover-battmon"))))
}

impl Program {
    fn load(path: &Path) -> Self {
        let file = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let elf = ElfFile32::<LittleEndian>::parse(&*file).expect("cargo links ELF files");
        let symbols = elf.symbols().filter_map(|symbol| read_symbol(&symbol)).collect();
        let sections = elf
            .sections()
            .filter_map(|section| read_section(&section))
            .collect();
        let mut marks: Vec<_> = elf
            .symbols()
            .filter_map(|symbol| {
                let name = symbol.name().ok()?;
                let is_code = name.starts_with("$t");
                (is_code || name.starts_with("$d")).then_some((symbol.address() as u32, is_code))
            })
            .collect();
        marks.sort();
        Self {
            symbols,
            sections,
            marks,
            file,
        }
    }

    /// What it takes of flash.
    pub fn flash_bytes(&self) -> u32 {
        self.sections
            .iter()
            .map(|section| section.bytes.len() as u32)
            .sum()
    }

    /// What it takes of RAM but for the stack.
    pub fn ram_bytes(&self) -> u32 {
        let in_ram = self.sections.iter().filter(|section| section.is_in_ram());
        in_ram.map(|section| section.size).sum()
    }

    /// The function an address lies in.
    pub fn function_at(&self, address: u32) -> Option<&Symbol> {
        let around = |symbol: &&Symbol| (symbol.address..symbol.address + symbol.size).contains(&address);
        self.symbols
            .iter()
            .filter(|symbol| symbol.is_function)
            .find(around)
    }

    /// The stretches of instructions.
    pub fn code(&self) -> impl Iterator<Item = (u32, &[u8])> {
        self.stretches(true)
    }

    /// The constants that lie between the instructions.
    pub fn constants(&self) -> impl Iterator<Item = (u32, &[u8])> {
        self.stretches(false)
    }

    fn stretches(&self, code: bool) -> impl Iterator<Item = (u32, &[u8])> {
        let ends = self.marks.iter().skip(1).map(|(address, _)| *address);
        let stretches = self.marks.iter().zip(ends.chain([u32::MAX]));
        stretches
            .filter(move |((_, is_code), _)| *is_code == code)
            .filter_map(|((start, _), end)| Some((*start, self.bytes(*start..end)?)))
    }

    /// What is stored at these addresses, to the end of the section at most.
    fn bytes(&self, range: Range<u32>) -> Option<&[u8]> {
        let holds = |section: &&Section| {
            (section.address..section.address + section.bytes.len() as u32).contains(&range.start)
        };
        let section = self.sections.iter().find(holds)?;
        let start = (range.start - section.address) as usize;
        let end = (range.end - section.address) as usize;
        Some(&section.bytes[start..end.min(section.bytes.len())])
    }
}

fn read_symbol<'data>(symbol: &impl ObjectSymbol<'data>) -> Option<Symbol> {
    let name = symbol.name().ok().filter(|name| !name.is_empty())?;
    let is_function = symbol.kind() == SymbolKind::Text;
    // A function's symbol has bit 0 set: Thumb.
    let address = symbol.address() as u32 & if is_function { !1 } else { !0 };
    Some(Symbol {
        name: demangled(name.strip_prefix(THUNK).unwrap_or(name)),
        address,
        size: symbol.size() as u32,
        is_function,
    })
}

fn read_section<'data>(section: &impl ObjectSection<'data>) -> Option<Section> {
    let object::SectionFlags::Elf { sh_flags } = section.flags() else {
        return None;
    };
    let takes_room = sh_flags & u64::from(object::elf::SHF_ALLOC) != 0 && section.size() > 0;
    takes_room.then(|| Section {
        name: section.name().unwrap_or_default().to_owned(),
        address: section.address() as u32,
        size: section.size() as u32,
        bytes: section.data().unwrap_or_default().to_vec(),
    })
}

/// By what the linker jumps between flash and RAM: it is called here as what it jumps to.
const THUNK: &str = "__Thumbv6MABSLongThunk_";

/// The name as it stands in the source, without the hash that rustc appends.
pub fn demangled(name: &str) -> String {
    format!("{:#}", rustc_demangle::demangle(name))
}
