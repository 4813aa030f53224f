//! The program `zmend`: arguments in, library calls, tables out. No algorithm lives here.

mod args;
mod bars;
mod cloud;
mod compare;
mod convert;
mod details;
mod digits;
mod extract;
mod features;
mod goal;
mod handles;
mod heal;
mod info;
mod interrupt;
mod json;
mod keep_good;
mod measure;
mod memory;
mod octmesh;
mod print;
mod render;
mod repair;
mod sample;
mod solid;
mod summary;
mod topology;
mod units;
mod volume;

use args::{Args, Command};
use std::process::ExitCode;
use zmend::{Error, Result};

fn main() -> ExitCode {
    let args = args::parse();
    interrupt::listen();
    match run(&args) {
        Ok(code) => code,
        Err(error @ Error::Cancelled) => {
            print::error(&error);
            ExitCode::from(interrupt::EXIT_CODE)
        }
        Err(error) => {
            print::error(&error);
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args) -> Result<ExitCode> {
    // The main thread works as well; its memory comes in larger steps than that of the others.
    let pool = rayon::ThreadPoolBuilder::new().use_current_thread().num_threads(args.threads.map_or(0, usize::from));
    pool.build_global().map_err(|e| Error::setting("threads", e.to_string(), "take fewer"))?;
    match &args.command {
        Command::Repair(args) => repair::run(args),
        Command::Topology(args) => topology::run(args),
        Command::Extract(args) => extract::run(args),
        Command::Remesh(args) => repair::remesh(args),
        Command::Surface(args) => cloud::surface(args),
        Command::Points(args) => cloud::points(args),
        Command::Octmesh(args) => octmesh::run(args),
        Command::Info(args) => info::run(args),
        Command::Compare(args) => compare::run(args),
        Command::Heal(args) => heal::run(args),
        Command::Features(args) => features::run(args),
        Command::Convert(args) => convert::run(args),
        Command::Sample(args) => sample::run(args),
        Command::Render(args) => render::run(args),
    }
}
