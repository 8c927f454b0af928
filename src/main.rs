use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(cousu::cli::run())
}
