#[global_allocator]
static ALLOCATOR: mixray::memory::EndWhenShort = mixray::memory::EndWhenShort;

fn main() -> std::process::ExitCode {
    mixray::cli::run()
}
