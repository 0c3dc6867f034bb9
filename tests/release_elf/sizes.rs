//! What the firmware takes: flash, RAM, the future of each task; and that it has no allocator.

use workbench::program::{FLASH_BUDGET_BYTES, Program, RAM_BUDGET_BYTES, Section, Symbol, release_firmware};

/// A task that is `async fn name` in main.rs has its future in a static of this name.
fn task_of(symbol: &Symbol) -> Option<&str> {
    let path = symbol.name.strip_suffix("::POOL")?;
    path.rsplit("::").next()
}

fn task_futures(program: &Program) -> Vec<(&str, u32)> {
    let pools = program.symbols.iter();
    let mut futures: Vec<_> = pools
        .filter_map(|symbol| Some((task_of(symbol)?, symbol.size)))
        .collect();
    futures.sort_by_key(|(_, size)| std::cmp::Reverse(*size));
    futures
}

#[test]
fn flash_and_ram_are_within_the_budget() {
    let program = release_firmware();
    let (flash, ram) = (program.flash_bytes(), program.ram_bytes());
    println!("flash {flash} bytes of {FLASH_BUDGET_BYTES}, static RAM {ram} bytes of {RAM_BUDGET_BYTES}");
    for name in [".text", ".rodata", ".data", ".quick", ".bss", ".uninit"] {
        let section = program.sections.iter().find(|section| section.name == name);
        println!("{:7}  {name}", section.map_or(0, |section| section.size));
    }
    assert!(flash > 0 && flash <= FLASH_BUDGET_BYTES, "{flash} bytes of flash");
    assert!(ram > 0 && ram <= RAM_BUDGET_BYTES, "{ram} bytes of RAM");
}

/// The boot ROM's stack grows down from here.
const BOOT_ROM_STACK: u32 = 0x2004_1F00;

#[test]
fn what_outlives_a_restart_is_a_kilobyte_below_the_boot_roms_stack() {
    let is_uninit = |section: &&Section| section.name == ".uninit";
    let section = release_firmware().sections.iter().find(is_uninit);
    let section = section.expect("something outlives a restart");
    assert!(section.address + section.size <= BOOT_ROM_STACK - 1024);
}

#[test]
fn the_future_of_every_task_is_listed() {
    let futures = task_futures(release_firmware());
    for (task, size) in &futures {
        println!("{size:7}  {task}");
    }
    let all: u32 = futures.iter().map(|(_, size)| *size).sum();
    println!("{all:7}  all tasks");
    let main = include_str!("../../src/bin/firmware/main.rs");
    let tasks = main.matches("#[embassy_executor::").count();
    assert_eq!(
        futures.len(),
        tasks,
        "tasks in main.rs, each with a future of its own"
    );
}

#[test]
fn nothing_allocates() {
    let names = release_firmware().symbols.iter().map(|symbol| &symbol.name);
    let allocator: Vec<_> = names.filter(|name| is_of_an_allocator(name)).collect();
    assert!(allocator.is_empty(), "{allocator:?}");
}

fn is_of_an_allocator(name: &str) -> bool {
    let parts = [
        "__rust_alloc",
        "__rust_dealloc",
        "__rust_realloc",
        "__rg_",
        "__rdl_",
        "__rust_no_alloc_shim",
        "alloc::alloc::",
    ];
    parts.iter().any(|part| name.contains(part))
        || ["malloc", "free", "calloc", "realloc"].contains(&name)
        || name.starts_with("alloc::")
        || name.starts_with("<alloc::")
}

#[test]
fn the_symbols_of_an_allocator_are_recognised() {
    for name in [
        "__rust_alloc",
        "__rustc::__rust_alloc",
        "alloc::raw_vec::handle_error",
        "<alloc::vec::Vec<T> as Drop>::drop",
    ] {
        assert!(is_of_an_allocator(name), "{name}");
    }
    for name in [
        "core::ops::drop",
        "embassy_usb::builder::alloc_endpoint_in",
        "SharedAllocation",
    ] {
        assert!(!is_of_an_allocator(name), "{name}");
    }
}
