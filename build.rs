//! Gives the linker its scripts when building for the board. A host build needs nothing, and firmware for another board
//! brings its own.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    println!("cargo:rerun-if-changed=memory.x");
    println!("cargo:rerun-if-changed=build.rs");
    let is_for_a_board = env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("none");
    if !is_for_a_board || env::var_os("CARGO_FEATURE_BOARD").is_none() {
        return;
    }
    let out_dir = PathBuf::from(env::var("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::copy("memory.x", out_dir.join("memory.x")).expect("memory.x can be copied");
    println!("cargo:rustc-link-search={}", out_dir.display());
    for kind in ["bins", "examples"] {
        println!("cargo:rustc-link-arg-{kind}=--nmagic");
        // Rings for DMA are aligned to their size: in front of all else they leave no gaps.
        println!("cargo:rustc-link-arg-{kind}=--sort-section=alignment");
        // src/board/pre_init.rs comes before embassy-rp's.
        println!("cargo:rustc-link-arg-{kind}=--wrap=__pre_init");
        for script in ["link.x", "link-rp.x", "defmt.x"] {
            println!("cargo:rustc-link-arg-{kind}=-T{script}");
        }
    }
}
