//! Arithmetic with singles as the release firmware does it: mostly by the boot ROM's routines, which have neither NaN nor
//! subnormal numbers.

use emulator::{BRANCH_TO_SELF, Random};
use workbench::bench::{Bench, DIVIDER_CODE, LINK_REGISTER, PROGRAM_COUNTER, SECOND};

const EXPONENT: u32 = 0x7f80_0000;
const SIGN: u32 = 0x8000_0000;

/// Both of everything that is special, and numbers around the bounds.
const SPECIAL: [f32; 14] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    1e-30,
    -1e30,
    f32::MAX,
    f32::MIN_POSITIVE,
    -f32::MIN_POSITIVE,
    f32::from_bits(1),
    f32::from_bits(0x807f_ffff),
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
];

/// The function that the compiler calls for an operation, and the operation by IEEE 754.
type Operation = (&'static str, fn(f32, f32) -> f32);

const DIVISION: &str = "__aeabi_fdiv";

const OPERATIONS: [Operation; 4] = [
    ("__aeabi_fadd", |a, b| a + b),
    ("__aeabi_fsub", |a, b| a - b),
    ("__aeabi_fmul", |a, b| a * b),
    (DIVISION, |a, b| a / b),
];

/// As IEEE 754 has it, but that subnormal numbers are zeros, unless one is divided by.
fn expected((symbol, by_ieee): Operation, a: f32, b: f32) -> f32 {
    let is_divided_by_zero = symbol == DIVISION && is_small(b);
    if !a.is_finite() || !b.is_finite() || is_divided_by_zero {
        return by_ieee(a, b);
    }
    without_subnormal(by_ieee(without_subnormal(a), without_subnormal(b)))
}

/// Whether it is zero or subnormal.
fn is_small(value: f32) -> bool {
    value.to_bits() & EXPONENT == 0
}

fn without_subnormal(value: f32) -> f32 {
    if is_small(value) {
        f32::from_bits(value.to_bits() & SIGN)
    } else {
        value
    }
}

/// Calls a function of the firmware from where the processor stands, and answers R0.
fn call(bench: &mut Bench, symbol: &str, [a, b]: [f32; 2]) -> u32 {
    let entry = bench.symbol(symbol) & !1;
    bench.set_register(0, a.to_bits());
    bench.set_register(1, b.to_bits());
    bench.set_register(LINK_REGISTER, BRANCH_TO_SELF | 1);
    bench.set_register(PROGRAM_COUNTER, entry);
    assert!(
        bench.run_until(1_000, |board| board.pc() == BRANCH_TO_SELF),
        "{symbol}"
    );
    bench.register(0)
}

fn in_a_task() -> Bench {
    let mut bench = Bench::running(DIVIDER_CODE);
    bench.run_into_task();
    bench
}

fn assert_operation(bench: &mut Bench, operation: Operation, a: f32, b: f32) {
    let expected = expected(operation, a, b);
    let (symbol, _) = operation;
    let result = f32::from_bits(call(bench, symbol, [a, b]));
    let is_as_expected = result.to_bits() == expected.to_bits() || result.is_nan() && expected.is_nan();
    assert!(
        is_as_expected,
        "{symbol} {a:e} {b:e}: {result:e}, not {expected:e}"
    );
}

#[test]
fn operations_are_those_of_ieee_754_but_for_subnormal_numbers() {
    let mut bench = in_a_task();
    for operation in OPERATIONS {
        for a in SPECIAL {
            for b in SPECIAL {
                assert_operation(&mut bench, operation, a, b);
            }
        }
    }
}

#[test]
fn operations_are_right_for_any_bits() {
    let mut bench = in_a_task();
    let mut random = Random::new(1);
    for _ in 0..500 {
        for operation in OPERATIONS {
            let bits = random.next_u64();
            let [a, b] = [bits as u32, (bits >> 32) as u32].map(f32::from_bits);
            assert_operation(&mut bench, operation, a, b);
        }
    }
}

/// The ROM divides by the hardware divider, which a task may be using.
#[test]
fn an_interrupt_handler_does_not_divide_by_the_rom() {
    let subnormal = f32::from_bits(0x0040_0000);
    let mut bench = in_a_task();
    let quotient = call(&mut bench, DIVISION, [subnormal, 1.0]);
    assert_eq!(quotient, 0, "by the ROM");

    let mut bench = Bench::running(DIVIDER_CODE);
    assert!(bench.run_until(SECOND, |board| board.active_exception() != 0));
    let quotient = call(&mut bench, DIVISION, [subnormal, 1.0]);
    assert_eq!(quotient, subnormal.to_bits(), "by the compiler's routine");
}

/// The ROM's comparison would take NaN for a number: plausibility checks rely on its being none.
#[test]
fn nothing_compares_with_nan() {
    let mut bench = in_a_task();
    for other in SPECIAL {
        for operands in [[f32::NAN, other], [other, f32::NAN]] {
            for symbol in ["lt", "le", "gt", "ge", "eq"] {
                let holds = call(&mut bench, &format!("__aeabi_fcmp{symbol}"), operands);
                assert_eq!(holds, 0, "{symbol} {operands:?}");
            }
            assert_ne!(call(&mut bench, "__aeabi_fcmpun", operands), 0, "{operands:?}");
        }
    }
}

/// The ROM's conversion would round down.
#[test]
fn conversions_to_integers_drop_the_fraction() {
    let mut bench = in_a_task();
    for (value, expected) in [(-1.5, -1), (-0.5, 0), (0.9, 0), (1e9, 1_000_000_000)] {
        let whole = call(&mut bench, "__aeabi_f2iz", [value, 0.0]) as i32;
        assert_eq!(whole, expected, "{value}");
    }
}
