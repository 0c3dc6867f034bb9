//! Tests of the processor as the board runs it, by small Thumb programs.

use super::bench::{RAM, set_registers};
use super::cpu::CpuState;
use super::thumb::*;

const NVIC_ISER: u32 = 0xe000_e100;
const NVIC_ISPR: u32 = 0xe000_e200;
const NVIC_IPR6: u32 = 0xe000_e418;
const UNMAPPED: u32 = 0x3000_0000;
const HARD_FAULT: u32 = 3;

/// Exception numbers of the software interrupts 26 and 27.
const LINE_26: u32 = 16 + 26;
const LINE_27: u32 = 16 + 27;

#[test]
fn starts_at_the_reset_vector_with_the_stack_pointer_from_the_vector_table() {
    let board = board(&[HANG], &[]);
    assert_eq!((board.pc(), board.register(13)), (MAIN, STACK_TOP));
}

#[test]
fn wfe_sleeps_until_an_event_and_a_stored_event_lets_the_next_one_through() {
    let mut board = board(&[SEV, WFE, adds(7, 1), WFE, adds(7, 1), HANG], &[]);
    board.set_register(7, 0);
    board.run_for(100);
    assert_eq!(board.register(7), 1, "the first WFE finds the event of SEV");
    assert_eq!(board.cpu_state(), CpuState::WaitingForEvent);
}

#[test]
fn an_interrupt_wakes_wfe_and_leaves_an_event_behind() {
    // Exception entry and return set the event register (ARMv6-M B1.5.18), so the loop goes round
    // twice for one interrupt.
    let mut board = board(&[WFE, adds(7, 1), back(2)], &[(LINE_26, &[BX_LR])]);
    board.set_register(7, 0);
    board.run_for(10);
    assert_eq!(board.cpu_state(), CpuState::WaitingForEvent);
    pend(&mut board, 1 << 26);
    board.run_for(10);
    assert_eq!(board.register(7), 2);
    assert_eq!(board.cpu_state(), CpuState::WaitingForEvent);
}

#[test]
fn with_interrupts_masked_wfi_wakes_and_wfe_does_not() {
    for (instruction, passes) in [(WFI, 1), (WFE, 0)] {
        let mut board = board(&[CPSID_I, instruction, adds(7, 1), HANG], &[]);
        board.set_register(7, 0);
        board.run_for(10);
        pend(&mut board, 1 << 26);
        board.run_for(10);
        assert_eq!(board.register(7), passes, "{instruction:#x}");
        assert_eq!(board.active_exception(), 0, "the interrupt itself is not taken");
    }
}

#[test]
fn sleeping_costs_no_awake_cycles() {
    let mut board = idle_board();
    board.run_for(1_000_000);
    assert!(board.awake_cycles() < 100, "{}", board.awake_cycles());
    assert!(board.instructions() < 10);
}

#[test]
fn a_software_interrupt_runs_once_each_time_it_is_pended() {
    // Lines 26 to 31 are real in the NVIC (datasheet 2.3.2). The handler pends itself again once.
    let handler = [adds(7, 1), store(6, 5), movs(6, 0), BX_LR];
    let mut board = board(&[WFI, back(1)], &[(LINE_26, &handler)]);
    set_registers(&mut board, [(7, 0), (6, 1 << 26), (5, NVIC_ISPR)]);
    board.run_for(10);
    pend(&mut board, 1 << 26);
    board.run_for(10);
    assert_eq!(board.register(7), 2);
}

#[test]
fn a_more_urgent_interrupt_preempts_a_handler_and_an_equal_one_waits() {
    for (priority_of_27, seen) in [(0x00, 1), (0x80, 0)] {
        // The handler of 26 pends 27, then keeps what R7 holds in R4.
        let low = [store(6, 5), NOP, NOP, 0x003c, BX_LR];
        let high = [adds(7, 1), BX_LR];
        let mut board = board(&[WFI, back(1)], &[(LINE_26, &low), (LINE_27, &high)]);
        set_registers(&mut board, [(7, 0), (6, 1 << 27), (5, NVIC_ISPR)]);
        store_system(&mut board, NVIC_IPR6, 0x80 << 16 | priority_of_27 << 24);
        store_system(&mut board, NVIC_ISER, 1 << 27);
        board.run_for(10);
        pend(&mut board, 1 << 26);
        board.run_for(10);
        assert_eq!(board.register(4), seen, "priority {priority_of_27:#x}");
        assert_eq!(board.register(7), 1, "it ran in the end");
        assert_eq!(board.active_exception(), 0);
    }
}

#[test]
fn a_load_from_nowhere_is_a_hard_fault_at_that_instruction() {
    let mut board = board(&[NOP, load(0, 1), HANG], &[]);
    board.set_register(1, UNMAPPED);
    board.run_for(10);
    assert_eq!(
        (board.active_exception(), board.pc()),
        (HARD_FAULT, handler(HARD_FAULT))
    );
    assert_eq!(stacked_pc(&board), MAIN + 2);
    let error = board.bus_errors()[0];
    assert_eq!((error.address, error.pc), (UNMAPPED, MAIN + 2));
}

#[test]
fn addresses_next_to_memories_and_peripherals_are_bus_errors() {
    // The crate answers zero for most of these.
    let addresses = [
        UNMAPPED,
        0x0000_4000,
        0x1fff_fffc,
        0x2004_2000,
        0x2100_0000,
        0x4007_0000,
        0xd000_0180,
        0xf000_0000,
    ];
    for address in addresses {
        for access in [load(0, 1), store(0, 1)] {
            let mut board = board(&[access, HANG], &[]);
            board.set_register(1, address);
            board.run_for(10);
            assert_eq!(
                board.active_exception(),
                HARD_FAULT,
                "{access:#x} at {address:#x}"
            );
        }
    }
}

#[test]
fn a_store_to_flash_is_ignored_and_noted_or_a_fault_by_its_alias() {
    for (address, exception) in [(0x1000_0000, 0), (0x1300_0000, HARD_FAULT)] {
        let mut board = board(&[store(0, 1), HANG], &[]);
        board.set_register(1, address);
        board.run_for(10);
        assert_eq!(board.active_exception(), exception, "{address:#x}");
        assert_eq!(board.read_word(0x1000_0000), 0xffff_ffff);
        assert_eq!(board.unmodelled().is_empty(), exception == HARD_FAULT);
    }
}

#[test]
fn running_into_nowhere_is_a_hard_fault_every_time() {
    let mut board = board(&[branch_to(1)], &[(HARD_FAULT, &[adds(7, 1), BX_LR])]);
    set_registers(&mut board, [(1, 0x2100_0001), (7, 0)]);
    board.run_for(10);
    assert!(
        board.register(7) > 3,
        "the handler returns to the same place: {}",
        board.register(7)
    );
}

#[test]
fn an_undefined_instruction_is_a_hard_fault() {
    let mut board = board(&[NOP, UDF], &[]);
    board.run_for(10);
    assert_eq!(board.active_exception(), HARD_FAULT);
    assert_eq!(stacked_pc(&board), MAIN + 2);
}

#[test]
fn a_fault_in_the_hard_fault_handler_is_a_lockup() {
    let mut board = board(&[UDF], &[(HARD_FAULT, &[NOP, UDF])]);
    board.run_for(10);
    assert!(board.is_locked_up());
    let instructions = board.instructions();
    board.run_for(1_000_000);
    assert_eq!(board.instructions(), instructions, "it stays stopped");
}

#[test]
fn a_stack_that_runs_out_of_the_bottom_of_ram_is_a_lockup() {
    // The push faults; so does stacking the registers for the HardFault.
    let mut board = board(&[push(0), back(1)], &[(HARD_FAULT, &[adds(7, 1), HANG])]);
    set_registers(&mut board, [(13, RAM + 16), (7, 0)]);
    board.run_for(100);
    assert!(board.is_locked_up());
    assert_eq!(board.register(7), 0, "the handler is not reached");
    assert_eq!(board.bus_errors()[0].address, RAM - 4);
}

#[test]
fn an_interrupt_that_cannot_be_stacked_is_a_lockup() {
    let mut board = board(&[WFI, back(1)], &[]);
    board.set_register(13, RAM);
    board.run_for(10);
    pend(&mut board, 1 << 26);
    board.run_for(10);
    assert!(board.is_locked_up());
}

#[test]
fn nothing_preempts_a_hard_fault() {
    let mut board = board(&[UDF], &[(LINE_26, &[adds(7, 1), BX_LR])]);
    board.set_register(7, 0);
    pend(&mut board, 1 << 26);
    board.set_register(15, MAIN);
    board.run_for(10);
    pend(&mut board, 1 << 26);
    board.run_for(10);
    assert_eq!(board.active_exception(), HARD_FAULT);
}

#[test]
fn code_in_ram_that_is_overwritten_runs_as_written_last() {
    let main = [call(1), store(2, 3), call(1), HANG];
    let mut board = board(&main, &[]);
    let code = RAM + 0x1000;
    let routine = |instruction: u16| u32::from(instruction) | u32::from(BX_LR) << 16;
    board.write_memory(code, &routine(adds(7, 1)).to_le_bytes());
    board.set_register(7, 0);
    board.set_register(1, code | 1);
    board.set_register(2, routine(adds(7, 16)));
    board.set_register(3, code);
    board.run_for(10);
    assert_eq!(board.register(7), 17);
}

#[test]
fn a_narrow_store_writes_a_whole_peripheral_register() {
    // The datasheet's own example (2.1.4): WATCHDOG.SCRATCH0 reads 0xa5a5a5a5 afterwards.
    let mut board = board(&[store_byte(0, 1), HANG], &[]);
    set_registers(&mut board, [(0, 0xa5), (1, 0x4005_800c)]);
    board.run_for(10);
    assert_eq!(board.read_register(0x4005_800c), 0xa5a5_a5a5);
}

/// Enable software interrupts and make them pending, as the program could.
fn pend(board: &mut super::Board, lines: u32) {
    store_system(board, NVIC_ISER, lines);
    store_system(board, NVIC_ISPR, lines);
}

fn store_system(board: &mut super::Board, address: u32, value: u32) {
    board.bus.store_system_control(address, value);
}

/// The return address in the exception frame on top of the stack.
fn stacked_pc(board: &super::Board) -> u32 {
    board.read_word(board.register(13) + 24)
}
