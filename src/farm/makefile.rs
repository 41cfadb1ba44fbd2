//! A Makefile: one host, or several with a shared folder through whatever runs lines of `make --dry-run`.

use super::{Job, OUTPUT, part_text, shell_words};

pub(super) fn files(job: &Job) -> Vec<(&'static str, String)> {
    let parts: Vec<String> = job.parts.iter().map(|part| part_text(*part)).collect();
    let task = escaped(&shell_words(&job.task, "\u{0}")).replace('\u{0}', "$*");
    let merge = escaped(&shell_words(&job.merge, ""));
    let encode = (job.encode.as_deref())
        .map(|command| format!("\n\tcd {OUTPUT} && {}", escaped(command)))
        .unwrap_or_default();
    let text = format!(
        "# make -j 4: four tasks at a time. Each is run again and keeps what an ended try has finished.\n\
        MIXRAY ?= mixray\nTASKS := $(addprefix part-,{parts})\n\n.PHONY: all tasks $(TASKS)\n\nall: tasks\n\t$(MIXRAY) {merge}{encode}\n\n\
        tasks: $(TASKS)\n\n$(TASKS): part-%:\n\t$(MIXRAY) {task}\n",
        parts = parts.join(" "),
    );
    vec![("Makefile", text)]
}

/// As make passes it on.
fn escaped(text: &str) -> String {
    text.replace('$', "$$")
}
