//! What a rover draws from its pack while it drives about.

/// One minute of driving: until when (in seconds into the minute) it draws how much (in amperes). Standing draws the
/// electronics' share; four small gear motors draw a few amperes, more when they start, turn or climb.
const CYCLE: [(f32, f32); 8] = [
    (8.0, 0.3),
    (9.0, 5.5),
    (24.0, 2.4),
    (29.0, 4.2),
    (40.0, 2.4),
    (44.0, 6.8),
    (54.0, 2.1),
    (60.0, 0.3),
];

const CYCLE_S: f32 = 60.0;

/// The current drawn at `time_s` since the start, in amperes.
pub fn load_current_a(time_s: f32) -> f32 {
    let into_cycle_s = time_s.rem_euclid(CYCLE_S);
    CYCLE
        .iter()
        .find(|(until_s, _)| into_cycle_s < *until_s)
        .map_or(CYCLE[0].1, |(_, current_a)| *current_a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cycle_repeats_each_minute_and_covers_all_of_it() {
        for second in 0..60 {
            let now = load_current_a(second as f32);
            assert!(now > 0.0);
            assert_eq!(now, load_current_a(second as f32 + 60.0));
        }
        assert_eq!(load_current_a(8.5), 5.5);
    }
}
