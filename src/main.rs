fn main() -> std::process::ExitCode {
    mixray::cli::run()
}
