//! The codec of the ML API against recorded exchanges of a real client: both ways, byte for byte.

use flotor_maglev::ml_api::*;
use serde_json::Value;

fn vectors() -> Value {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/cases/maglev-api-vectors.json");
    serde_json::from_str(&std::fs::read_to_string(file).expect("the vectors are there")).expect("JSON")
}

fn rows<'a>(vectors: &'a Value, key: &str) -> &'a [Value] {
    vectors[key].as_array().expect("a list")
}

fn bytes(hex: &Value) -> Vec<u8> {
    let hex = hex.as_str().expect("bytes in hex");
    let byte = |at: usize| u8::from_str_radix(&hex[at..at + 2], 16).expect("hex");
    (0..hex.len()).step_by(2).map(byte).collect()
}

#[allow(clippy::cast_possible_truncation)] // the table says floats in decimal
fn float(value: &Value) -> f32 {
    value.as_f64().expect("a number") as f32
}

fn int(value: &Value) -> i32 {
    i32::try_from(value.as_i64().expect("an integer")).expect("32 bits")
}

fn floats<const N: usize>(values: &Value) -> [f32; N] {
    let values: Vec<f32> = values.as_array().expect("a list").iter().map(float).collect();
    values.try_into().expect("the right number of them")
}

fn axis(arguments: &Value) -> Axis {
    Axis::ALL[usize::try_from(int(&arguments["axis"])).expect("an axis")]
}

fn set(arguments: &Value) -> GainSet {
    GainSet::ALL[usize::try_from(int(&arguments["gainset"])).expect("a set")]
}

fn gain(arguments: &Value) -> Gain {
    Gain::ALL[usize::try_from(int(&arguments["gain"])).expect("a gain")]
}

fn pid(values: &Value) -> Pid {
    let [p, i, d, ff] = floats(values);
    Pid { p, i, d, ff }
}

fn pids(values: &Value) -> [Pid; 6] {
    let all: [f32; 24] = floats(values);
    std::array::from_fn(|axis| Pid {
        p: all[4 * axis],
        i: all[4 * axis + 1],
        d: all[4 * axis + 2],
        ff: all[4 * axis + 3],
    })
}

fn offsets(of: &Value) -> [CellOffset; 3] {
    ["a_x_y_t", "b_x_y_t", "c_x_y_t"].map(|cell| {
        let [x, y, t] = floats(&of[cell]);
        CellOffset { x, y, t }
    })
}

/// The request of a row, from what its caller said.
fn request(row: &Value) -> Request {
    let arguments = &row["arguments"];
    let function = Function::of(int(&row["id"])).expect("a known function");
    match function {
        Function::ConstrainAxis => Request::ConstrainAxis {
            axis: axis(arguments),
            range: [float(&arguments["min"]), float(&arguments["max"])],
        },
        Function::GetForceAxis | Function::LockAxis | Function::UnlockAxis => {
            Request::OfAxis(function, axis(arguments))
        }
        Function::GetGainVecAxes | Function::ResetGainVecAxes => Request::OfSet(function, set(arguments)),
        Function::GetGainVecAxis => Request::GetGainVecAxis(set(arguments), axis(arguments)),
        Function::GetGainVecSingle => {
            Request::GetGainVecSingle(set(arguments), axis(arguments), gain(arguments))
        }
        Function::SetForceAxis => Request::SetForceAxis(axis(arguments), float(&arguments["force"])),
        Function::SetGainVecAxes => {
            Request::SetGainVecAxes(set(arguments), pids(&arguments["p_i_d_ff_by_axis"]))
        }
        Function::SetGainVecAxis => {
            Request::SetGainVecAxis(set(arguments), axis(arguments), pid(&arguments["p_i_d_ff"]))
        }
        Function::SetGainVecGrasp => Request::SetGainVecGrasp(pid(&arguments["p_i_d_ff"])),
        Function::SetGainVecSingle => Request::SetGainVecSingle(
            set(arguments),
            axis(arguments),
            gain(arguments),
            float(&arguments["value"]),
        ),
        Function::SetDesiredPosition | Function::SetFrame => {
            Request::Pose(function, WirePose { out_of_range: false, at: floats(&arguments["values"]) })
        }
        Function::SetLatCellOffset => Request::SetLatCellOffset(offsets(arguments)),
        Function::MapToken => Request::MapToken(int(&arguments["token"])),
        _ if function.registers().is_some() || function.unregisters().is_some() => {
            Request::Register(function, int(&arguments["process_id"]))
        }
        _ => match arguments.as_object().expect("arguments").iter().next() {
            None => Request::Plain(function),
            Some((_, values)) if values.is_array() => Request::AxisValues(function, floats(values)),
            Some((_, value)) => Request::Number(function, float(value)),
        },
    }
}

/// The results of a row, from what its caller was given.
fn results(row: &Value) -> Results {
    let decoded = &row["decoded"];
    match Results::zero(Function::of(int(&row["id"])).expect("a known function")) {
        Results::None => Results::None,
        Results::Number(_) => Results::Number(float(&decoded["value"])),
        Results::AxisValues(_) => Results::AxisValues(floats(&decoded["values"])),
        Results::Pose(_) => Results::Pose(pose(decoded)),
        Results::Modes(_) => unreachable!("the recorded client never asks"),
        Results::Buttons(_) => Results::Buttons(buttons(decoded)),
        Results::Cells(_) => {
            let cells = decoded["cells"].as_array().expect("a list");
            Results::Cells(std::array::from_fn(|cell| Cell {
                x: float(&cells[cell]["x"]),
                y: float(&cells[cell]["y"]),
                is_valid: int(&cells[cell]["valid"]) != 0,
            }))
        }
        Results::Fault(_) => Results::Fault(fault(decoded)),
        Results::Gains(_) => Results::Gains(pids(&decoded["p_i_d_ff_by_axis"])),
        Results::Pid(_) => Results::Pid(pid(&decoded["p_i_d_ff"])),
        Results::CellOffsets(_) => Results::CellOffsets(offsets(decoded)),
        Results::Voltages(_) => Results::Voltages(floats(&decoded["values"])),
        Results::Version(_) => {
            Results::Version(Version::new(decoded["server"].as_str().expect("text").as_bytes()))
        }
        Results::Token(_) => Results::Token(int(&decoded["token"])),
    }
}

fn pose(decoded: &Value) -> WirePose {
    WirePose { out_of_range: int(&decoded["out_of_range"]) != 0, at: floats(&decoded["values"]) }
}

fn buttons(decoded: &Value) -> Buttons {
    Buttons { left: int(&decoded["left"]) != 0, right: int(&decoded["right"]) != 0 }
}

fn fault(decoded: &Value) -> FaultBits {
    FaultBits(u32::try_from(int(&decoded["bits"])).expect("bits"))
}

#[test]
fn recorded_exchanges_have_these_bytes_both_ways() {
    let vectors = vectors();
    for row in rows(&vectors, "functions") {
        let name = &row["function"];
        let (request, sent) = (request(row), bytes(&row["request"]));
        assert_eq!(request.encode().bytes(), sent, "{name}");
        assert_eq!(Request::decode(&sent), Ok(request), "{name}");
        // What its caller was returned is the status, but for a client that keeps an error to itself.
        let (reply, received) =
            (Reply { status: Status(int(&row["returned"])), results: results(row) }, bytes(&row["reply"]));
        assert_eq!(reply.encode().bytes(), received, "{name}");
        assert_eq!(Reply::decode(request.function(), &received), Some(reply), "{name}");
    }
    assert_eq!(rows(&vectors, "functions").len(), 70);
}

#[test]
fn recorded_events_have_these_bytes_both_ways() {
    let vectors = vectors();
    for row in rows(&vectors, "callbacks") {
        let (decoded, message) = (&row["decoded"], bytes(&row["message"]));
        let event = match int(&row["id"]) {
            71 => Event::End,
            74 => Event::Button(buttons(decoded)),
            75 => {
                let sides: Vec<i32> = decoded["values"].as_array().expect("a list").iter().map(int).collect();
                Event::Boundary(sides.try_into().expect("seven"))
            }
            76 => Event::Overtemp(floats(&decoded["values"])),
            77 => Event::Fault(fault(decoded)),
            _ if decoded.is_object() => Event::Tick(pose(decoded)),
            _ => Event::decode(&message).expect("a tick"),
        };
        assert_eq!(event.encode().bytes(), message, "{row}");
        assert_eq!(Event::decode(&message), Some(event), "{row}");
        let answer = row
            .get("handler_returned")
            .map_or(Acknowledgement::UNHANDLED, |value| Acknowledgement(int(value)));
        let acknowledged = bytes(&row["acknowledgement"]);
        assert_eq!(answer.encode().bytes(), acknowledged, "{row}");
        assert_eq!(Acknowledgement::decode(&acknowledged), Some(answer), "{row}");
    }
}

#[test]
fn the_recorded_session_is_understood_on_both_connections() {
    let vectors = vectors();
    let mut asked = None;
    for row in rows(&vectors, "session") {
        let frame = bytes(&row["hex"]);
        let said = (row["connection"].as_str(), row["from"].as_str());
        let again = match (said, asked.take()) {
            ((_, Some("client")), None) if Request::decode(&frame).is_ok() => {
                let request = Request::decode(&frame).expect("as above");
                asked = Some(request.function());
                request.encode()
            }
            ((Some("callback"), Some("client")), _) => Acknowledgement::decode(&frame).expect("one").encode(),
            ((_, Some("server")), Some(function)) => Reply::decode(function, &frame).expect("one").encode(),
            ((Some("callback"), Some("server")), None) => Event::decode(&frame).expect("one").encode(),
            other => panic!("{other:?} in {row}"),
        };
        assert_eq!(again.bytes(), frame, "{row}");
    }
}

#[test]
fn errors_carry_the_full_results_and_short_replies_are_none() {
    for function in Function::ALL {
        let failed = Reply::failed(Some(*function), Status::OFF_LINE);
        let frame = failed.encode();
        assert_eq!(Reply::decode(*function, frame.bytes()), Some(failed), "{function:?}");
        // A version has no fixed length: one that is empty is its end alone.
        let shorter = frame.bytes().len() - 1;
        if failed.results != Results::None {
            let mut short = frame.bytes()[..shorter].to_vec();
            short[0] = u8::try_from(shorter).expect("short");
            let whole = *function == Function::GetAxisModes;
            assert_eq!(Reply::decode(*function, &short).is_none(), !whole, "{function:?}");
        }
    }
    let bytes_of = |function| Reply::failed(Some(function), Status::AXIS).encode().bytes().len();
    assert_eq!(bytes_of(Function::GetCellPosition), 8 + 27);
    assert_eq!(bytes_of(Function::GetAxisModes), 40);
    assert_eq!(Reply::failed(None, Status::UNKNOWN).encode().bytes(), [8, 0, 0, 0, 255, 255, 255, 255]);
}

#[test]
fn requests_that_cannot_be_obeyed_say_why() {
    let refused = |bytes: &[u8]| Request::decode(bytes).map_err(|unreadable| unreadable.status);
    let frame = |fields: &[i32]| -> Vec<u8> {
        let length = i32::try_from(4 + 4 * fields.len()).expect("short");
        [&[length], fields].concat().iter().flat_map(|field| field.to_le_bytes()).collect()
    };
    for id in [0, 13, 35, 70, 74, 99, -1] {
        assert_eq!(refused(&frame(&[id])), Err(Status::UNKNOWN), "{id}");
    }
    for axis in [6, 7, -1, i32::MAX] {
        assert_eq!(refused(&frame(&[34, axis])), Err(Status::AXIS), "{axis}");
    }
    assert_eq!(refused(&frame(&[18, 4])), Err(Status::GAIN_TYPE));
    assert_eq!(refused(&frame(&[21, 0, 0, 4])), Err(Status::GAIN_TYPE));
    assert_eq!(refused(&frame(&[49, 0])), Err(Status::COMMUNICATION));
    // What is more than needed is ignored.
    assert_eq!(refused(&frame(&[5, 1, 2, 3])), Ok(Request::Plain(Function::GetActualPosition)));
    assert_eq!(refused(&[]), Err(Status::UNKNOWN));
}
