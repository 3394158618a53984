//! A device of Flotor for programs written for the Maglev 200: a scene with that device and the controller as its model, run by
//! the host. What stands between program and hand is what stands there in every run.

use super::{Arguments, ProtocolOption};
use flotor_hal::Refusal;
use flotor_maglev::ml_api::PORT;
use std::error::Error;
use std::fmt::Write;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// Becomes `flotor run`; comes back only if that cannot be.
pub(crate) fn become_host(device: &str, arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    if arguments.protocol != ProtocolOption::MlApi {
        return Err(Refusal::parameter("--device needs --protocol ml-api").into());
    }
    let file = std::env::temp_dir().join(format!("flotor-ml-api-{}.toml", std::process::id()));
    std::fs::write(&file, scene(device, arguments)?)
        .map_err(|error| format!("{}: {error}", file.display()))?;
    let host = std::env::current_exe()?.with_file_name(format!("flotor{}", std::env::consts::EXE_SUFFIX));
    let record = &arguments.ml_api.record;
    let error = Command::new(&host).arg("run").arg(&file).arg("--record").arg(record).exec();
    Err(format!("{}: {error}; `cargo build --release` makes it", host.display()).into())
}

fn scene(device: &str, arguments: &Arguments) -> Result<String, Box<dyn Error>> {
    // Until Ctrl-C.
    let mut scene = format!("duration_s = 3.0e7\n[device]\nplugin = {device:?}\n[device.parameters]\n");
    for text in &arguments.sets {
        let (key, value) = text
            .split_once('=')
            .ok_or_else(|| Refusal::parameter(format!("--set {text}: write KEY=VALUE")))?;
        // Numbers as they are, everything else as text.
        match value.trim().parse::<f64>() {
            Ok(number) => writeln!(scene, "{} = {number:?}", key.trim())?,
            Err(_) => writeln!(scene, "{} = {:?}", key.trim(), value.trim())?,
        }
    }
    let listen = arguments.listen.clone().unwrap_or_else(|| format!("127.0.0.1:{PORT}"));
    let parameters = arguments.ml_api.model_parameters();
    write!(scene, "[[model]]\nplugin = \"ml-api\"\n[model.parameters]\nlisten = {listen:?}\n{parameters}")?;
    Ok(scene)
}
