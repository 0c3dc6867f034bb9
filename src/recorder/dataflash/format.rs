//! The formats, a row each, with the units in use: everything that a file says about its records derives from them.

/// Length of what precedes the fields, in bytes: two of synchronisation and the format's number.
pub const HEADER_BYTES: usize = 3;

/// Identifies a format. The numbers are free but for FMT's, since a file states them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    Format = 128,
    Unit = 129,
    Multiplier = 130,
    FormatUnits = 131,
    Parameter = 132,
    Message = 133,
    Event = 134,
    Arming = 135,
    Mode = 136,
    Error = 137,
    Battery = 138,
    Cells = 139,
    MoreCells = 140,
    Estimate = 141,
    Health = 142,
    Crash = 143,
    Gps = 144,
    Board = 145,
    Pack = 146,
    Curve = 147,
    FailsafeTimer = 148,
    Report = 149,
    Command = 150,
}

/// A format, as its FMT and FMTU records say it: a character and a name for each field.
#[derive(Clone, Copy, Debug)]
pub struct Format {
    pub kind: Kind,
    /// Up to 4 characters.
    pub name: &'static str,
    /// The type of each field, see [`field_bytes`].
    pub types: &'static str,
    /// Names of the fields, with commas between them.
    pub columns: &'static str,
    /// Units of the fields, see [`UNITS`].
    pub units: &'static str,
    /// Factors that make the number in a field one in that unit, see [`MULTIPLIERS`].
    pub multipliers: &'static str,
}

impl Format {
    /// Length of a record, in bytes.
    pub fn record_bytes(&self) -> usize {
        HEADER_BYTES + self.types.bytes().map(field_bytes).sum::<usize>()
    }
}

/// Length of a field, in bytes, by the character of its type; only those in use.
fn field_bytes(field_type: u8) -> usize {
    match field_type {
        // Signed and unsigned byte, mode.
        b'b' | b'B' | b'M' => 1,
        // Signed, signed in hundredths, unsigned.
        b'h' | b'c' | b'H' => 2,
        // Signed, signed in hundredths, unsigned, degrees, single, short text.
        b'i' | b'e' | b'I' | b'L' | b'f' | b'n' => 4,
        // Unsigned, double.
        b'Q' | b'd' => 8,
        // Texts.
        b'N' => 16,
        b'Z' => 64,
        _ => 0,
    }
}

/// All formats, FMT first, since a reader needs it to read the others.
pub const FORMATS: [Format; 23] = [
    Format {
        kind: Kind::Format,
        name: "FMT",
        types: "BBnNZ",
        columns: "Type,Length,Name,Format,Columns",
        units: "-b---",
        multipliers: "-----",
    },
    Format {
        kind: Kind::Unit,
        name: "UNIT",
        types: "QbZ",
        columns: "TimeUS,Id,Label",
        units: "s--",
        multipliers: "F--",
    },
    Format {
        kind: Kind::Multiplier,
        name: "MULT",
        types: "Qbd",
        columns: "TimeUS,Id,Mult",
        units: "s--",
        multipliers: "F--",
    },
    Format {
        kind: Kind::FormatUnits,
        name: "FMTU",
        types: "QBNN",
        columns: "TimeUS,FmtType,UnitIds,MultIds",
        units: "s---",
        multipliers: "F---",
    },
    Format {
        kind: Kind::Parameter,
        name: "PARM",
        types: "QNff",
        columns: "TimeUS,Name,Value,Default",
        units: "s---",
        multipliers: "F---",
    },
    Format {
        kind: Kind::Message,
        name: "MSG",
        types: "QZ",
        columns: "TimeUS,Message",
        units: "s-",
        multipliers: "F-",
    },
    Format {
        kind: Kind::Event,
        name: "EV",
        types: "QB",
        columns: "TimeUS,Id",
        units: "s-",
        multipliers: "F-",
    },
    Format {
        kind: Kind::Arming,
        name: "ARM",
        types: "QBIBB",
        columns: "TimeUS,ArmState,ArmChecks,Forced,Method",
        units: "s----",
        multipliers: "F----",
    },
    Format {
        kind: Kind::Mode,
        name: "MODE",
        types: "QMBB",
        columns: "TimeUS,Mode,ModeNum,Rsn",
        units: "s---",
        multipliers: "F---",
    },
    Format {
        kind: Kind::Error,
        name: "ERR",
        types: "QBB",
        columns: "TimeUS,Subsys,ECode",
        units: "s--",
        multipliers: "F--",
    },
    Format {
        kind: Kind::Battery,
        name: "BAT",
        types: "QBfffffcfBBB",
        columns: "TimeUS,Inst,Volt,VoltR,Curr,CurrTot,EnrgTot,Temp,Res,RemPct,H,SH",
        units: "s#vvAaXOw%-%",
        multipliers: "F-000C0?0000",
    },
    Format {
        kind: Kind::Cells,
        name: "BCL",
        types: "QBfHHHHHHHHHHHH",
        columns: "TimeUS,Instance,Volt,V1,V2,V3,V4,V5,V6,V7,V8,V9,V10,V11,V12",
        units: "s#vvvvvvvvvvvvv",
        multipliers: "F-0CCCCCCCCCCCC",
    },
    Format {
        kind: Kind::MoreCells,
        name: "BCL2",
        types: "QBHHHH",
        columns: "TimeUS,Instance,V13,V14,V15,V16",
        units: "s#vvvv",
        multipliers: "F-CCCC",
    },
    Format {
        kind: Kind::Estimate,
        name: "BATX",
        types: "QBfffffBHBBff",
        columns: "TimeUS,Inst,SoC,SoCLo,SoCHi,Use,Cap,State,Flt,FS,Stat,VMin,IMax",
        units: "s#%%%%a----vA",
        multipliers: "F-0000C----00",
    },
    Format {
        kind: Kind::Health,
        name: "PM",
        types: "QHI",
        columns: "TimeUS,Load,LogDrop",
        units: "s%-",
        multipliers: "FA-",
    },
    Format {
        kind: Kind::Crash,
        name: "CRSH",
        types: "QBIIIN",
        columns: "TimeUS,Cause,PC,LR,PSR,Task",
        units: "s-----",
        multipliers: "F-----",
    },
    // ArduPilot's, but that `Status` has a sign and what is not measured has no unit.
    Format {
        kind: Kind::Gps,
        name: "GPS",
        types: "QBbIHBcLLeffffB",
        columns: "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U",
        units: "s#-s-----------",
        multipliers: "F--C-----------",
    },
    Format {
        kind: Kind::Board,
        name: "BRD",
        types: "QN",
        columns: "TimeUS,Id",
        units: "s-",
        multipliers: "F-",
    },
    Format {
        kind: Kind::Pack,
        name: "PACK",
        types: "QBiBBHfffffff",
        columns: "TimeUS,Inst,SN,Chem,Cells,Drv,Cap,CapD,Res,Res1,SoC,SoCD,RstV",
        units: "s#----a-ww--v",
        multipliers: "F-----C-00--0",
    },
    Format {
        kind: Kind::Curve,
        name: "PCKO",
        types: "QBhhhhhhhhhh",
        columns: "TimeUS,Inst,O1,O2,O3,O4,O5,D1,D2,D3,D4,D5",
        units: "s#vvvvvvvvvv",
        multipliers: "F-DDDDDDDDDD",
    },
    Format {
        kind: Kind::FailsafeTimer,
        name: "FSTM",
        types: "QBBB",
        columns: "TimeUS,Inst,FS,Tmr",
        units: "s#--",
        multipliers: "F---",
    },
    Format {
        kind: Kind::Report,
        name: "BATR",
        types: "QBBHffB",
        columns: "TimeUS,Inst,Err,OvD,WhR,WhF,Mode",
        units: "s#%-XX-",
        multipliers: "F-0-00-",
    },
    Format {
        kind: Kind::Command,
        name: "MAVC",
        types: "QBBBBBHffffiifBB",
        columns: "TimeUS,TS,TC,SS,SC,Fr,Cmd,P1,P2,P3,P4,X,Y,Z,Res,WL",
        units: "s---------------",
        multipliers: "F---------------",
    },
];

/// Units that the formats use, by ArduPilot's characters, with their names.
pub const UNITS: [(u8, &str); 11] = [
    (b'-', ""),
    (b'#', "instance"),
    (b's', "s"),
    (b'v', "V"),
    (b'A', "A"),
    (b'a', "Ah"),
    (b'X', "W.h"),
    (b'O', "degC"),
    (b'w', "Ohm"),
    (b'%', "%"),
    (b'b', "B"),
];

/// Multipliers that the formats use, by ArduPilot's characters, with their values. `-` is for what is not a number; `?` is ArduPilot's for hundredths of a degree, which the type
/// of the field divides already.
pub const MULTIPLIERS: [(u8, f64); 7] = [
    (b'-', 0.0),
    (b'?', 1.0),
    (b'0', 1.0),
    (b'A', 1e-1),
    (b'C', 1e-3),
    (b'D', 1e-4),
    (b'F', 1e-6),
];
