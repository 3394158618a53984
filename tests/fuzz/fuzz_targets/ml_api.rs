//! Any bytes give requests, replies and events of the ML API or nothing, never a panic; what is read says the same when it is
//! said again.
#![no_main]

use flotor_maglev::ml_api::{Acknowledgement, Event, Function, Intake, ReadResult, Reply, Request};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(request) = Request::decode(bytes) {
        let said = request.encode();
        let again = Request::decode(said.bytes()).expect("what was said can be read");
        assert_eq!(again.encode().bytes(), said.bytes());
    }
    for function in Function::ALL {
        if let Some(reply) = Reply::decode(*function, bytes) {
            let said = reply.encode();
            let again = Reply::decode(*function, said.bytes()).expect("what was said can be read");
            assert_eq!(again.encode().bytes(), said.bytes());
        }
    }
    if let Some(event) = Event::decode(bytes) {
        let said = event.encode();
        assert_eq!(Event::decode(said.bytes()).expect("as before").encode().bytes(), said.bytes());
    }
    let _ = Acknowledgement::decode(bytes);
    let (mut intake, mut stream) = (Intake::default(), bytes);
    while let ReadResult::Frame(length) = intake.take(&mut stream) {
        assert_eq!(intake.frame().len(), length);
    }
});
