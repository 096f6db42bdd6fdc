use std::io::{Read, Write};
use std::net::TcpListener;

use super::*;
use crate::distribution::Distribution;
use crate::experiment::Force;
use crate::parameter::Support;
use crate::rheology::Declared;

/// A server that gives every request the same answer, as it stands; what its errors are.
fn errors_of(answer: &'static str) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut buffer = [0; 4096];
        let _ = stream.read(&mut buffer);
        let _ = stream.write_all(answer.as_bytes());
        // Held open where nothing is answered, so that only patience ends it.
        if answer.is_empty() {
            std::thread::sleep(Duration::from_secs(2));
        }
    });
    asked(&url)
}

fn asked(url: &str) -> String {
    let declared = Declared {
        name: "stiffness".into(),
        unit: "N/m".into(),
        support: Support::POSITIVE,
        prior: Distribution::LogNormal { median: 1.0, log_sd: 0.5 },
    };
    let law = OutsideLaw::new(url, "forward", &[declared]);
    let client = Client { patience: Duration::from_millis(400), ..Client::new(law, None) };
    let drive = Drive::commanded(&[0.0, 1.0], Force::from(&[1.0, 1.0]));
    match client.evaluate(&[2.0], &drive) {
        Ok(position_m) => format!("{position_m:?}"),
        Err(error) => error.to_string(),
    }
}

/// An answer of HTTP with a body.
macro_rules! http {
    ($status:literal, $body:literal) => {
        concat!("HTTP/1.1 ", $status, "\r\nConnection: close\r\n\r\n", $body)
    };
}

#[test]
fn answers_are_metres_and_mistakes_are_named_with_their_remedy() {
    let cases = [
        (http!("200 OK", "{\"output\": [[0, 2.5]]}"), &["[0.0, 2.5e-6]"][..]),
        (http!("200 OK", "{\"output\": [[0, 1, 2]]}"), &["answers 3 numbers for 2 times", "what to do", "time_s"]),
        (http!("200 OK", "{\"output\": [[0, NaN]]}"), &["no JSON", "what to do"]),
        (http!("200 OK", "{\"output\": [[0, null]]}"), &["answers null at 1 s for stiffness = 2", "narrow"]),
        (http!("200 OK", "{\"outputs\": 3}"), &["without a vector in `output`"]),
        (
            http!("400 Bad Request", "{\"error\": {\"type\": \"InvalidInput\", \"message\": \"too stiff\"}}"),
            &["status 400", "too stiff"],
        ),
        (http!("500 Internal", "Traceback: division"), &["status 500", "Traceback: division"]),
        ("SSH-2.0-OpenSSH_9.0\r\n\r\n", &["does not speak HTTP", "UM-Bridge"]),
        ("", &["has not answered for 0.4 s", "what to do"]),
    ];
    for (answer, words) in cases {
        let found = errors_of(answer);
        for word in words {
            assert!(found.contains(word), "`{word}` is missing: {found}");
        }
    }
    // A port that was free a moment ago.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    drop(listener);
    let found = asked(&url);
    assert!(found.contains("cannot be reached") && found.contains("--forward"), "{found}");
}

#[test]
fn a_call_ends_when_the_job_is_stopped() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = Address::of(&format!("http://{}", listener.local_addr().unwrap()));
    let stop = AtomicBool::new(true);
    let began = std::time::Instant::now();
    assert_eq!(request(&address, "/Info", None, Duration::from_secs(60), Some(&stop)), Err(Failure::Stopped));
    assert!(began.elapsed() < Duration::from_secs(1));
}
