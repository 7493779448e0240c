//! `bench`: the page of a bench; and `monitor`, the same in a terminal.

use std::fs;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use tokio::net::TcpListener;

use super::prelude::*;
use super::{commission, options};
use crate::bench::session::Session;
use crate::bench::shared::Place;
use crate::bench::terminal::{self as window, Address};
use crate::bench::web::{self, Site};
use crate::interrupt;
use crate::simulation::board::SimulatedBoard;
use crate::simulation::film;

/// The address of the page, for `monitor`, in the folder.
const ADDRESS: &str = "bench.url";
/// How often Ctrl-C is looked for.
const LOOK: Duration = Duration::from_millis(50);

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    film: FilmOptions,
    /// Parameters that the board runs until its next reset (TOML), or preset:NAME; those that it keeps if left out.
    #[arg(long, value_name = "P")]
    params: Option<String>,
    /// Take calibrations and limits of the paper's bench (6 kV at the most) where the parameters have none; implied by --plant.
    #[arg(long)]
    bench: bool,
    /// Folder for the recordings of the runs, and for the record of commissioning.
    #[arg(long, value_name = "DIR", default_value = "bench")]
    out: PathBuf,
    /// References to offer, besides the recordings in the folder.
    #[arg(long, value_name = "REF.csv", num_args = 1..)]
    reference: Vec<PathBuf>,
    /// File with the tables `[actuator]` and `[board]`: offers to commission the film.
    #[arg(long, value_name = "B.toml")]
    board: Option<String>,
    /// Address of the page on this computer; port 0 takes any that is free.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:0", value_parser = loopback)]
    listen: SocketAddr,
    /// Ticks per sample of the recording.
    #[arg(long, value_name = "TICKS", default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..=1000))]
    every: u16,
}

/// Where the film is.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct FilmOptions {
    /// Port of a controller: a serial port such as /dev/ttyUSB0, or tcp:HOST:PORT.
    #[arg(long, value_name = "PORT")]
    port: Option<String>,
    /// A simulated film.
    #[arg(long, value_name = "FILM", value_parser = named::<film::Plant>())]
    plant: Option<film::Plant>,
}

/// An address that only this computer reaches.
fn loopback(text: &str) -> std::result::Result<SocketAddr, String> {
    let address: SocketAddr = text.parse().map_err(|_| "an address and a port are needed, such as 127.0.0.1:8080")?;
    if address.ip().is_loopback() {
        Ok(address)
    } else {
        Err("only this computer may reach the page (127.0.0.1 or [::1]); from another one, forward the port with ssh -L".into())
    }
}

/// The arguments of a bench with a simulated film, as `demo` has them.
pub(super) fn simulated(film: film::Plant, params: &Path, reference: &Path, out: &Path) -> Arguments {
    Arguments {
        film: FilmOptions { port: None, plant: Some(film) },
        params: Some(params.to_string_lossy().into_owned()),
        bench: true,
        out: out.into(),
        reference: vec![reference.into()],
        board: None,
        listen: SocketAddr::from(([127, 0, 0, 1], 0)),
        every: 10,
    }
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let is_bench = arguments.bench || arguments.film.plant.is_some();
    let blob = |name: &String| options::blob_to_drive(name, &options::load(name)?, 1000.0, is_bench);
    let blob = arguments.params.as_ref().map(blob).transpose()?;
    for reference in &arguments.reference {
        fs::metadata(reference).map_err(|e| Error::file(reference, e))?;
    }
    let commissioning =
        arguments.board.as_ref().map(|board| commission::sittings(board, &arguments.out)).transpose()?;
    let folder = Folder::at(&arguments.out)?;
    let address_file = arguments.out.join(ADDRESS);
    output::check(&address_file, &[], output::Folders::Exist)?;
    let simulated = arguments.film.plant.map(|film| SimulatedBoard::start(film, 1)).transpose()?;
    let port = simulated.as_ref().map(|board| board.port.clone()).or_else(|| arguments.film.port.clone());
    let place = Place { port: port.unwrap_or_default(), folder: arguments.out.clone(), every: arguments.every, blob };
    // From here on Ctrl-C comes to an end at 0 V.
    let stop = interrupt::live_film();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|e| Error::Computation(format!("the page: {e}")))?;
    let served = runtime.block_on(async {
        let refused = |e: std::io::Error| Error::field("listen", format!("{}: {e}", arguments.listen));
        let listener = TcpListener::bind(arguments.listen).await.map_err(refused)?;
        let own = listener.local_addr().map_err(refused)?;
        let hosts = vec![own.to_string(), format!("localhost:{}", own.port())];
        let mut site = Site::new(Session::begin(place), hosts, arguments.out.clone());
        site.references.clone_from(&arguments.reference);
        site.sittings = commissioning;
        let address = format!("http://{own}/#{}", site.secret);
        write_address(&address_file, &address)?;
        terminal::report(json, &serde_json::json!({ "address": address }), || {
            format!("{address}\nOpen this address in a browser on this computer; Ctrl-C ends it at 0 V.")
        })?;
        let site = Arc::new(site);
        web::serve(listener, web::router(Arc::clone(&site)), ended(stop)).await;
        site.session.end();
        Ok(())
    });
    // Requests that are not done yet, such as those of open pages.
    runtime.shutdown_background();
    let _ = fs::remove_file(&address_file);
    drop(simulated);
    drop(folder);
    served
}

async fn ended(stop: &AtomicBool) {
    while !stop.load(Ordering::Relaxed) {
        tokio::time::sleep(LOOK).await;
    }
}

/// Writes the address with its secret where only this user reads it.
fn write_address(path: &Path, address: &str) -> Result<()> {
    let _ = fs::remove_file(path);
    let mut options = fs::OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let written = options.open(path).and_then(|mut file| std::io::Write::write_all(&mut file, address.as_bytes()));
    written.map_err(|e| Error::file(path, e))
}

#[derive(Debug, Args)]
pub(super) struct MonitorArguments {
    /// Folder of the bench that runs.
    #[arg(value_name = "DIR", default_value = "bench")]
    folder: PathBuf,
    /// Print the state once, instead of drawing it.
    #[arg(long)]
    once: bool,
}

pub(super) fn monitor(arguments: &MonitorArguments, json: bool) -> Result<()> {
    let path = arguments.folder.join(ADDRESS);
    let text = fs::read_to_string(&path).map_err(|e| {
        Error::file(&path, format!("{e}; name the folder (`out`) of a springpot bench that runs on this computer"))
    })?;
    let address: Address = text.parse().map_err(|e: String| Error::file(&path, e))?;
    let no_bench = |e: std::io::Error| Error::file(&path, format!("{e}; the bench does not run any more"));
    if arguments.once || json {
        let live = address.states().and_then(|mut states| states.next_state()).map_err(no_bench)?;
        return terminal::report(json, &live, || window::lines(&live).join("\n"));
    }
    window::show(&address).map_err(|e| Error::Computation(with_flags(&format!("{}: {e}", shown(&path)))))
}
