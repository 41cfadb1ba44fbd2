//! A Slurm job array, and the job that waits for it.

use std::fmt::Write;

use super::{Job, OUTPUT, part_text, quoted, shell_words};

/// The program, unless the environment names another.
const PROGRAM: &str = "\"${MIXRAY:-mixray}\"";

pub(super) fn files(job: &Job) -> Vec<(&'static str, String)> {
    let parts: String = (job.parts.iter())
        .map(|part| part_text(*part) + "\n")
        .collect();
    let name = quoted(&job.name);
    let tasks = format!(
        "{head}#SBATCH --array=0-{last}\n#SBATCH --requeue\n\
        # A task is a line of parts.txt. What an ended try has finished is kept.\n\
        part=$(sed -n \"$((SLURM_ARRAY_TASK_ID + 1))p\" parts.txt)\n{PROGRAM} {task}\n",
        head = head(job, "task-%a.log"),
        last = job.parts.len() - 1,
        task = shell_words(&job.task, "$part"),
    );
    let encode = (job.encode.iter()).fold(String::new(), |_, command| {
        format!("cd {OUTPUT}\n{command}\n")
    });
    let merge = format!(
        "{head}#SBATCH --requeue\nset -e\n{PROGRAM} {merge}\n{encode}",
        head = head(job, "merge.log"),
        merge = shell_words(&job.merge, ""),
    );
    // Not `afterok`: of an array it is never met once a try of a task has failed, though the next one succeeds (Slurm 22.05).
    let submit = format!(
        "#!/bin/sh\n# Hands the job over: the tasks, and what puts them together once all have ended and looks at what each has left.\n\
        # Options for sbatch may follow.\n\
        set -e\ncd \"$(dirname \"$0\")\"\ntasks=$(sbatch --parsable --job-name={name} \"$@\" tasks.sbatch)\n\
        sbatch --job-name={name} --dependency=\"afterany:${{tasks%%;*}}\" \"$@\" merge.sbatch\n"
    );
    vec![
        ("parts.txt", parts),
        ("tasks.sbatch", tasks),
        ("merge.sbatch", merge),
        ("submit.sh", submit),
    ]
}

fn head(job: &Job, log: &str) -> String {
    let mut head = format!("#!/bin/sh\n#SBATCH --output={log}\n");
    let asked = &job.requirements;
    // A String takes all that is written.
    let _ = asked
        .cpus
        .map(|n| writeln!(head, "#SBATCH --cpus-per-task={n}"));
    let _ = asked
        .memory_mib
        .map(|n| writeln!(head, "#SBATCH --mem={n}M"));
    let _ = asked.gpus.map(|n| writeln!(head, "#SBATCH --gpus={n}"));
    head
}
