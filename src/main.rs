use std::process::ExitCode;

fn main() -> ExitCode {
    match cousu::cli::run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("cousu: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
