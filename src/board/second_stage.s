// The second stage, the first 256 bytes of flash: makes the flash chip readable by address.
//
// The boot ROM starts a copy of it at the end of RAM with LR = 0 (RP2040 datasheet, 2.8.1.3.1), and it goes on to the
// vector table. After each operation of the flash chip the driver calls a copy on the stack, which returns. The ROM's
// flash_exit_xip has run before both: the chip takes serial commands.
//
// The chip is read on four lines if bit QE of its status register 2 is set; nothing is written then. A chip that left the
// factory without the bit is given it until its power fails: by 31h, and where that has no effect by 01h with both
// registers. 50h in front of either, "Write Enable for Volatile Status Register" (W25Q16JV, 8.2.2), keeps it from being
// stored, so nothing wears. A chip that takes neither is read on one line.
//
// It is position-independent, at most 252 bytes long, and keeps R4 to R11. `python3 .ci/second_stage.py` assembles it.

    .syntax unified
    .thumb

// Pads (RP2040, 2.19.6.4). The clock: 8 mA, fast slew rate, no input. Data: 4 mA, an input without the delay of a Schmitt
// trigger; SD2 and SD3 are pulled up, as a chip without QE takes them for /WP and /HOLD.
    .equ PADS_QSPI_SCLK, 0x40020004
    .equ PAD_CLOCK, 2 << 4 | 1 << 0
    .equ PAD_DATA, 1 << 6 | 1 << 4
    .equ PAD_PULL_UP, 1 << 3

// XIP_SSI (RP2040, 4.10.13).
    .equ SSI_BASE, 0x18
    .equ SSI_BASE_SHIFT, 24
    .equ CTRLR0, 0x00
    .equ CTRLR1, 0x04
    .equ SSIENR, 0x08
    .equ BAUDR, 0x14
    .equ SR, 0x28
    .equ DR0, 0x60
    .equ RX_SAMPLE_DLY, 0xf0
    .equ SPI_CTRLR0, 0xf4
// SR of an interface that has sent all it had to, and holds nothing that was received.
    .equ SR_IDLE, 1 << 2 | 1 << 1
    .equ SR_RX_NOT_EMPTY_BIT, 3

// CTRLR0: frames of 8 bits in both directions; or of 32 bits, received behind an address, on one line or on four.
    .equ COMMANDS, 7
    .equ COMMANDS_SHIFT, 16
    .equ READS_SINGLE, 31 << 16 | 3 << 8
    .equ READS_QUAD, 2 << 21 | READS_SINGLE

// SPI_CTRLR0 of reads. Single: instruction and 24 bits of address on one line.
    .equ SINGLE, READ << 24 | 2 << 8 | 6 << 2
// Quad, the first: the instruction on one line, 24 bits of address, 8 mode bits, 4 clocks of pause.
    .equ QUAD_FIRST, 4 << 11 | 2 << 8 | 8 << 2 | 1
// Quad, those behind it: without the instruction, as the mode bits of each say of the next one.
    .equ QUAD, CONTINUOUS << 24 | 4 << 11 | 8 << 2 | 2

// Dividers of the system clock, 125 MHz. The W25Q16JV takes 03h up to 50 MHz.
    .equ FAST, 2
    .equ SLOW, 4

// Commands of the flash chip.
    .equ WRITE_STATUS_1, 0x01
    .equ READ, 0x03
    .equ READ_STATUS_1, 0x05
    .equ WRITE_STATUS_2, 0x31
    .equ READ_STATUS_2, 0x35
    .equ WRITE_ENABLE_VOLATILE, 0x50
    .equ READ_QUAD, 0xeb
    .equ CONTINUOUS, 0xa0

// Bit 0 of status register 1 is BUSY.
    .equ QE_BIT, 1
    .equ QE, 1 << QE_BIT

    .equ VECTOR_TABLE, 0x10000100
    .equ VTOR, 0xe000ed08

second_stage:
    push    {r4-r7, lr}
    ldr     r0, =PADS_QSPI_SCLK
    movs    r1, #PAD_CLOCK
    movs    r2, #PAD_DATA
    mov     r3, r2
    movs    r4, #PAD_DATA | PAD_PULL_UP
    mov     r5, r4
    stmia   r0!, {r1-r5}

    // R3 stays XIP_SSI, R7 the divider.
    movs    r3, #SSI_BASE
    lsls    r3, r3, #SSI_BASE_SHIFT
    movs    r7, #SLOW
    movs    r0, #COMMANDS
    lsls    r0, r0, #COMMANDS_SHIFT
    bl      set_up

    // Commands left to set QE by: 31h, then 01h.
    movs    r6, #2
look:
    movs    r0, #READ_STATUS_2
    bl      read_status
    lsls    r1, r0, #31 - QE_BIT
    bmi     read_quad
    adds    r4, r0, #QE
    subs    r6, #1
    beq     by_01h
    bmi     read_single
    lsls    r0, r4, #8
    adds    r0, #WRITE_STATUS_2
    movs    r1, #2
    b       write_status
by_01h:
    // Status register 1, in R5, stays as it is.
    lsls    r0, r4, #8
    orrs    r0, r5
    lsls    r0, r0, #8
    adds    r0, #WRITE_STATUS_1
    movs    r1, #3
write_status:
    push    {r0, r1}
    movs    r0, #WRITE_ENABLE_VOLATILE
    movs    r1, #1
    bl      exchange
    pop     {r0, r1}
    bl      exchange

    // A volatile write does not make the chip busy (8.2.5). A chip that stores all the same takes 10 to 30 ms, and can't be
    // read until then: 65,536 looks at a system clock of 125 MHz are some 50 ms.
    movs    r4, #1
    lsls    r4, r4, #16
busy:
    movs    r0, #READ_STATUS_1
    bl      read_status
    mov     r5, r0
    lsrs    r0, r0, #1
    bcc     look
    subs    r4, #1
    bne     busy
    b       look

read_single:
    ldr     r0, =READS_SINGLE
    ldr     r1, =SINGLE
    b       read

read_quad:
    movs    r7, #FAST
    ldr     r0, =READS_QUAD
    ldr     r1, =QUAD_FIRST
    bl      set_up
    movs    r1, #READ_QUAD
    str     r1, [r3, #DR0]
    // Of address 0.
    movs    r1, #CONTINUOUS
    str     r1, [r3, #DR0]
    bl      finish
    ldr     r0, =READS_QUAD
    ldr     r1, =QUAD
read:
    bl      set_up

    pop     {r4-r7}
    pop     {r0}
    cmp     r0, #0
    beq     start
    bx      r0
start:
    ldr     r0, =VECTOR_TABLE
    ldr     r1, =VTOR
    str     r0, [r1]
    ldmia   r0!, {r1, r2}
    mov     sp, r1
    bx      r2

// Sets up the interface with CTRLR0 in R0 and SPI_CTRLR0 in R1, which commands do not use. Uses R2 and R4.
set_up:
    movs    r4, #0
    str     r4, [r3, #SSIENR]
    str     r0, [r3, #CTRLR0]
    // One frame.
    str     r4, [r3, #CTRLR1]
    str     r7, [r3, #BAUDR]
    movs    r2, #SPI_CTRLR0
    str     r1, [r3, r2]
    // Data is taken a cycle of the system clock after the edge, as the chip needs time to put it out.
    movs    r4, #1
    movs    r2, #RX_SAMPLE_DLY
    str     r4, [r3, r2]
    str     r4, [r3, #SSIENR]
    bx      lr

// The status register that the command in R0 reads, in R0. Uses R1 and R2.
read_status:
    movs    r1, #2

// Sends the R1 lowest bytes of R0, the lowest first; the last byte received is in R0. Uses R1 and R2. It fills the FIFO
// quicker than that is sent: an empty one would deselect the chip.
exchange:
    uxtb    r2, r0
    str     r2, [r3, #DR0]
    lsrs    r0, r0, #8
    subs    r1, #1
    bne     exchange

// Waits until the chip is deselected; the last frame received is in R0. Uses R1 and R2.
finish:
    ldr     r1, [r3, #SR]
    lsrs    r2, r1, #SR_RX_NOT_EMPTY_BIT + 1
    bcc     1f
    ldr     r0, [r3, #DR0]
1:  cmp     r1, #SR_IDLE
    bne     finish
    bx      lr

    .pool
