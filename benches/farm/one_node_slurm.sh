#!/bin/sh
# A Slurm of this one machine, for tests, as root: one_node_slurm.sh start FOLDER, one_node_slurm.sh stop FOLDER.
# apt-get install slurmctld slurmd slurm-client munge
set -eu
command=$1
mkdir -p "$2"
folder=$(cd "$2" && pwd)
host=$(hostname -s)

if [ "$command" = stop ]; then
    for name in slurmd slurmctld munged; do
        [ ! -f "$folder/$name.pid" ] || kill "$(cat "$folder/$name.pid")" || true
    done
    exit
fi

mkdir -p "$folder/state" "$folder/spool" "$folder/munge"
[ -f "$folder/munge/key" ] || (umask 077 && dd if=/dev/urandom of="$folder/munge/key" bs=128 count=1 2>/dev/null)
chmod 755 "$folder" "$folder/munge"
socket=$folder/munge/socket
# A task that was killed ends with 137, and is run again after `cred_expire` seconds; below 5, Slurm takes its default, 120.
cat >"$folder/slurm.conf" <<CONF
ClusterName=one
SlurmctldHost=$host
SlurmUser=root
AuthType=auth/munge
CryptoType=crypto/munge
AuthInfo=socket=$socket,cred_expire=5
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=sched_interval=2,batch_sched_delay=0
RequeueExit=137
MpiDefault=none
NodeName=$host CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
munged --force --key-file="$folder/munge/key" --socket="$socket" --pid-file="$folder/munged.pid" \
    --log-file="$folder/munge/log" --seed-file="$folder/munge/seed"
export SLURM_CONF="$folder/slurm.conf"
slurmctld
slurmd
echo "export SLURM_CONF=$SLURM_CONF"
