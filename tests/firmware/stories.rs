//! Some of the stories of `tests/stories/` on the release firmware: those in which a converter, a clock or a flash has a part.
//! `tests/host/stories.rs` has all of them in stepped time.

use support::story::{Story, play};
use workbench::bench::Bench;

/// A test for each story.
macro_rules! stories {
    ($($name:ident)*) => {
        $(
            #[test]
            fn $name() {
                play::<Bench>(&Story::named(stringify!($name)));
            }
        )*
    };
}

stories! {
    // Timers, to the tick, and a level that stays.
    low_voltage_has_to_last
    // A converter that stalls, and works again.
    sensor_lost_while_driving
    // Single readings without a pack.
    sense_wire_that_flickers
    // Two inputs.
    the_most_severe_of_two_packs
    // A current below the offset of its sensor.
    charging
    // Motors that coast, and turn with another pack.
    terminate_ends_with_a_fuller_pack
    // Packs that are taken out and put in, and a wire that is loose.
    another_pack_while_usb_keeps_the_board_on
    the_same_pack_put_back
    loose_wire_at_the_voltage
    // A pack that is learnt, kept in flash, and forgotten with the next.
    aged_pack_is_swapped
}
