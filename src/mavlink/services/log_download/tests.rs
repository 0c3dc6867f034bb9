use proptest::prelude::*;

use super::*;
use crate::system::{LogReader, LogReaders};
use crate::time::at_us;

const LINK: u16 = 1;

const STATION: Peer = Peer {
    system_id: 255,
    component_id: 190,
};

const OTHER: Peer = Peer {
    system_id: 254,
    component_id: 190,
};

const SECOND: u64 = 1_000_000;

const EVERYTHING: LogListRequest = LogListRequest {
    start: 0,
    end: u16::MAX,
};

fn files(first: u16, sizes: &[u32]) -> Vec<LogFile> {
    let numbers = (0..).map(|place| (u32::from(first) - 1 + place) % NUMBERS + 1);
    let with_sizes = numbers.zip(sizes);
    with_sizes
        .map(|(number, bytes)| LogFile {
            number: number as u16,
            bytes: *bytes,
            began_utc_s: None,
        })
        .collect()
}

fn state(logs: &[LogFile]) -> SystemState<'_> {
    SystemState {
        logs,
        ..SystemState::default()
    }
}

/// What a file holds at `offset`.
fn byte(number: u16, offset: u32) -> u8 {
    (u32::from(number) * 31 + offset * 7 + offset / 256) as u8
}

fn content(number: u16, from: u32, bytes: u32) -> Vec<u8> {
    (from..from + bytes).map(|offset| byte(number, offset)).collect()
}

/// Everything that is sent until nothing is left, with the files read as asked for.
fn sent(download: &mut LogDownload, state: &SystemState<'_>) -> Vec<Message> {
    let mut sent = Vec::new();
    loop {
        match download.step(state) {
            Step::Idle => return sent,
            Step::Send(Outgoing::Message(message)) => sent.push(message),
            Step::Send(other) => panic!("{other:?}"),
            Step::Read(read) => {
                let bytes = content(read.number, read.offset, u32::from(read.bytes));
                let message = download.supply(read, &bytes).expect("it was asked for");
                sent.push(message.expect("it is whole"));
            }
        }
    }
}

/// Id, length, number of files.
fn entries(messages: &[Message]) -> Vec<(u16, u32, u16)> {
    let entry = |message: &Message| match message {
        Message::LogEntry(entry) => (entry.id, entry.size, entry.num_logs),
        other => panic!("{other:?}"),
    };
    messages.iter().map(entry).collect()
}

/// Id, offset, bytes.
fn data(messages: &[Message]) -> Vec<(u16, u32, Vec<u8>)> {
    let data = |message: &Message| match message {
        Message::LogData(data) => (data.id, data.ofs, data.data[..usize::from(data.count)].to_vec()),
        other => panic!("{other:?}"),
    };
    messages.iter().map(data).collect()
}

fn list(download: &mut LogDownload, logs: &[LogFile], start: u16, end: u16) -> Vec<(u16, u32, u16)> {
    let state = state(logs);
    let listed = download.list(&LogListRequest { start, end }, STATION, &state);
    assert_eq!(listed, Ok(()));
    entries(&sent(download, &state))
}

fn request(id: u16, offset: u32, bytes: u32) -> LogDataRequest {
    LogDataRequest { id, offset, bytes }
}

fn read(
    download: &mut LogDownload,
    logs: &[LogFile],
    id: u16,
    offset: u32,
    bytes: u32,
) -> Vec<(u16, u32, Vec<u8>)> {
    let state = state(logs);
    let requested = download.request_data(&request(id, offset, bytes), STATION, &state);
    assert_eq!(requested, Ok(()));
    data(&sent(download, &state))
}

#[test]
fn a_list_has_an_entry_for_each_file_of_the_range() {
    let logs = files(7, &[100, 200, 300]);
    let mut download = LogDownload::default();
    let all = [(1, 100, 3), (2, 200, 3), (3, 300, 3)];
    for start in [0, 1] {
        assert_eq!(list(&mut download, &logs, start, u16::MAX), all);
    }
    assert_eq!(list(&mut download, &logs, 2, 2), all[1..2]);
    assert_eq!(list(&mut download, &logs, 2, 9), all[1..]);
    for (start, end) in [(4, 9), (3, 2), (u16::MAX, u16::MAX)] {
        let listed = list(&mut download, &logs, start, end);
        assert_eq!(listed, [(0, 0, 3)], "{start} {end}");
    }
}

#[test]
fn a_list_of_no_files_is_one_entry_that_says_so() {
    let mut download = LogDownload::default();
    assert_eq!(list(&mut download, &[], 0, u16::MAX), [(0, 0, 0)]);
}

#[test]
fn ids_stay_while_the_oldest_file_is_dropped_until_everything_is_listed_again() {
    let before = files(u16::MAX - 1, &[100, 200, 300, 400]);
    let mut download = LogDownload::default();
    let ids = |entries: Vec<(u16, u32, u16)>| entries.into_iter().map(|(id, ..)| id).collect::<Vec<_>>();
    assert_eq!(ids(list(&mut download, &before, 0, u16::MAX)), [1, 2, 3, 4]);
    let after = &before[1..];
    assert_eq!(list(&mut download, after, 1, 3), [(2, 200, 4), (3, 300, 4)]);
    // The number after 65535 is 1.
    let third = read(&mut download, after, 3, 0, 10);
    assert_eq!(third, [(3, 0, content(1, 0, 10))]);
    let dropped = download.request_data(&request(1, 0, 10), STATION, &state(after));
    assert_eq!(dropped, Err(Refusal::Gone), "the one that was dropped");
    assert_eq!(ids(list(&mut download, after, 0, u16::MAX)), [1, 2, 3]);
}

#[test]
fn of_an_unknown_file_nothing_is_sent() {
    let logs = files(1, &[1000]);
    let state = state(&logs);
    let mut download = LogDownload::default();
    for id in [0, 2, u16::MAX] {
        let before = download.request_data(&request(1, 0, u32::MAX), STATION, &state);
        assert_eq!(before, Ok(()));
        let requested = download.request_data(&request(id, 0, 90), STATION, &state);
        assert_eq!(requested, Err(Refusal::Gone));
        assert_eq!(
            download.step(&state),
            Step::Idle,
            "it has replaced the one before"
        );
        assert_eq!(download.request_data(&request(1, 0, 90), OTHER, &state), Ok(()));
        download.stop();
    }
}

#[test]
fn another_request_replaces_what_is_being_sent() {
    let logs = files(1, &[1000, 500]);
    let state = state(&logs);
    let mut download = LogDownload::default();
    let requested = download.request_data(&request(1, 0, u32::MAX), STATION, &state);
    assert_eq!(requested, Ok(()));
    let Step::Read(late) = download.step(&state) else {
        panic!("nothing to read");
    };
    let requested = download.request_data(&request(2, 450, 50), STATION, &state);
    assert_eq!(requested, Ok(()));
    assert_eq!(download.supply(late, &[1; 90]), None, "not wanted any more");
    let sent = data(&sent(&mut download, &state));
    assert_eq!(sent, [(2, 450, content(2, 450, 50))]);
    assert_eq!(download.supply(late, &[1; 90]), None, "nothing is wanted");
}

#[test]
fn the_second_station_waits_until_the_first_ends_or_is_silent() {
    let logs = files(1, &[200]);
    let at = |us| SystemState {
        now: at_us(us),
        ..state(&logs)
    };
    let mut download = LogDownload::default();
    let ask =
        |download: &mut LogDownload, from, us| download.request_data(&request(1, 0, u32::MAX), from, &at(us));
    assert_eq!(ask(&mut download, STATION, 0), Ok(()));
    // For as long as something is sent.
    assert_eq!(ask(&mut download, OTHER, 100 * SECOND), Err(Refusal::InUse));
    let during = at(100 * SECOND);
    assert_eq!(download.list(&EVERYTHING, OTHER, &during), Err(Refusal::InUse));
    download.end(OTHER);
    assert_eq!(sent(&mut download, &at(100 * SECOND)).len(), 3);
    // And for five seconds after that, in which gaps are requested again.
    assert_eq!(ask(&mut download, OTHER, 105 * SECOND - 1), Err(Refusal::InUse));
    assert_eq!(ask(&mut download, OTHER, 105 * SECOND), Ok(()));
    assert_eq!(ask(&mut download, STATION, 105 * SECOND), Err(Refusal::InUse));
    download.end(OTHER);
    assert_eq!(ask(&mut download, STATION, 105 * SECOND), Ok(()));
}

#[test]
fn what_was_read_on_another_link_is_not_erased_for_ten_seconds() {
    let logs = files(1, &[200]);
    let mut readers = LogReaders::NONE;
    readers.note(LogReader::Link(LINK + 1, LogProtocol::FileTransfer), 1, at_us(0));
    let log_readers = &readers;
    for (link, us, expected) in [
        (LINK, 10 * SECOND - 1, Err(Refusal::InUse)),
        (LINK, 10 * SECOND, Ok(())),
        (LINK + 1, 1, Ok(())),
    ] {
        let state = SystemState {
            now: at_us(us),
            log_readers,
            ..state(&logs)
        };
        let erased = LogDownload::default().erase(STATION, link, &state);
        assert_eq!(erased, expected, "link {link} after {us} us");
    }
}

#[test]
fn what_another_station_has_taken_on_the_same_link_is_not_erased_for_ten_seconds() {
    let logs = files(1, &[200]);
    let at = |us| SystemState {
        now: at_us(us),
        ..state(&logs)
    };
    let mut download = LogDownload::default();
    assert_eq!(
        download.request_data(&request(1, 0, u32::MAX), STATION, &at(0)),
        Ok(())
    );
    let Step::Read(_) = download.step(&at(SECOND)) else {
        panic!("nothing to read");
    };
    assert_eq!(
        download.erase(OTHER, LINK, &at(11 * SECOND - 1)),
        Err(Refusal::InUse)
    );
    assert_eq!(download.erase(OTHER, LINK, &at(11 * SECOND)), Ok(()));
}

#[test]
fn erasing_ends_a_download_and_numbers_anew() {
    let before = files(1, &[200, 300]);
    let mut download = LogDownload::default();
    let requested = download.request_data(&request(1, 0, 90), STATION, &state(&before));
    assert_eq!(requested, Ok(()));
    assert_eq!(download.erase(STATION, LINK, &state(&before)), Ok(()));
    assert_eq!(download.step(&state(&[])), Step::Idle);
    let after = files(3, &[50]);
    assert_eq!(read(&mut download, &after, 1, 0, 50), [(1, 0, content(3, 0, 50))]);
}

/// Around the ends of messages, and any.
fn around_messages() -> impl Strategy<Value = u32> {
    let ends = prop::sample::select(vec![0u32, 1, 89, 90, 91, 179, 180, 181]);
    prop_oneof![ends, 0u32..400]
}

proptest! {
    /// A message that is not full, or an empty one, says that the file ends before what was requested.
    #[test]
    fn any_request_ends_and_sends_what_the_file_has(
        sizes in prop::collection::vec(around_messages(), 1..5),
        first in 1u16..,
        requests in prop::collection::vec(
            (1u16..5, prop_oneof![around_messages(), any::<u32>()], prop_oneof![around_messages(), any::<u32>()]),
            1..8,
        ),
    ) {
        let logs = files(first, &sizes);
        let mut download = LogDownload::default();
        for (id, offset, bytes) in requests {
            let Some(file) = logs.get(usize::from(id) - 1) else { continue };
            let end = offset.saturating_add(bytes);
            let expected = content(file.number, offset, end.min(file.bytes).saturating_sub(offset));
            let mut parts: Vec<_> = expected.chunks(DATA_BYTES).map(<[u8]>::to_vec).collect();
            if end > file.bytes && expected.len().is_multiple_of(DATA_BYTES) {
                parts.push(vec![]);
            }
            let offsets = (offset..).step_by(DATA_BYTES);
            let messages: Vec<_> = offsets.zip(parts).map(|(offset, part)| (id, offset, part)).collect();
            prop_assert_eq!(read(&mut download, &logs, id, offset, bytes), messages);
        }
    }
}
