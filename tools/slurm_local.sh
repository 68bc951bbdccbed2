#!/bin/sh
# A real Slurm on this one machine, to try sweeps on that are meant for a cluster: controller, node, accounting.
#
#   apt-get install slurm-wlm slurmdbd munge mariadb-server    # Debian; nothing of it needs to run by itself
#   tools/slurm_local.sh up FOLDER                             # all its files lie in FOLDER, which must not exist yet
#   export SLURM_CONF=FOLDER/slurm.conf
#   s2a train -m hydra/launcher=submitit_slurm seed=0,1,2,3 stage=/path/to/sim.usd out=run
#   sacct --format=JobID,JobName,State,Elapsed,ExitCode
#   tools/slurm_local.sh down FOLDER                           # ends it and removes FOLDER
#
# It listens on the ports 26817 to 26820 of this machine. submitit asks sacct how its jobs are, hence the accounting: without
# it a job that is killed is waited for forever. Everything runs as whoever calls, root or not.
set -eu

PATH=$PATH:/usr/sbin:/sbin
MARK=slurm_local # a file by which `down` knows a folder of `up`, also of one that failed halfway
DAEMONS="slurmd slurmctld slurmdbd munged mariadbd" # in the order in which they are ended

main() {
    [ $# = 2 ] || { echo "usage: $0 up|down FOLDER" >&2; exit 2; }
    folder=$(realpath -m "$2")
    export SLURM_CONF="$folder/slurm.conf"
    case $1 in
        up) up ;;
        down) down ;;
        *) echo "$0: '$1' is neither up nor down" >&2; exit 2 ;;
    esac
}

up() {
    for program in $DAEMONS; do
        command -v "$program" > /dev/null || { echo "$0: $program is not installed; see the head of this file" >&2; exit 1; }
    done
    [ ! -e "$folder" ] || { echo "$0: $folder exists; end what runs there with: $0 down $folder" >&2; exit 1; }
    mkdir -m 755 -p "$folder" "$folder/state" "$folder/spool" "$folder/log"
    touch "$folder/$MARK"
    start_munge
    start_database
    write_settings
    start slurmdbd -D
    wait_for "accounting" sacctmgr -n show cluster
    sacctmgr -i add cluster local > /dev/null
    start slurmctld -D
    wait_for "controller" scontrol ping
    start slurmd -D
    wait_for "node" node_is_idle
    sinfo
    echo "Slurm is up: export SLURM_CONF=$SLURM_CONF"
}

down() {
    [ -f "$folder/$MARK" ] || { echo "$0: $folder holds no Slurm of this script" >&2; exit 1; }
    scancel --user="$(id -un)" 2> /dev/null || true
    for program in $DAEMONS; do
        pid=$(cat "$folder/$program.pid" 2> /dev/null) || continue
        kill "$pid" 2> /dev/null || continue
        for _ in $(seq 100); do kill -0 "$pid" 2> /dev/null || break; sleep 0.1; done
    done
    rm -rf "$folder"
}

# Authenticates the daemons to each other: a key and a socket of our own.
start_munge() {
    dd if=/dev/urandom of="$folder/munge.key" bs=1024 count=1 2> /dev/null
    chmod 600 "$folder/munge.key"
    start munged --foreground --force --key-file="$folder/munge.key" --socket="$folder/munge.socket" \
        --seed-file="$folder/munge.seed" --log-file="$folder/log/munged.log" --pid-file="$folder/munged.own.pid"
    wait_for "munge" test -S "$folder/munge.socket"
}

# Keeps what became of the jobs.
start_database() {
    password=$(od -An -N16 -tx1 /dev/urandom | tr -d ' \n')
    mariadb-install-db --no-defaults --user="$(id -un)" --datadir="$folder/database" --auth-root-authentication-method=normal \
        --skip-test-db > "$folder/log/database.log" 2>&1
    start mariadbd --no-defaults --user="$(id -un)" --datadir="$folder/database" --socket="$folder/database.socket" \
        --bind-address=127.0.0.1 --port=26820 --pid-file="$folder/mariadbd.own.pid"
    wait_for "database" database "SELECT 1"
    database "CREATE USER slurm IDENTIFIED BY '$password'; CREATE DATABASE slurm_acct_db; GRANT ALL ON slurm_acct_db.* TO slurm"
    database "ALTER USER root@localhost IDENTIFIED BY '$password'"
}

database() {
    mariadb --no-defaults --user=root --socket="$folder/database.socket" --execute="$1"
}

write_settings() {
    common="AuthType=auth/munge
AuthInfo=socket=$folder/munge.socket
SlurmUser=$(id -un)"
    cat > "$folder/slurmdbd.conf" << END
$common
DbdHost=localhost
DbdPort=26819
PidFile=$folder/slurmdbd.own.pid
LogFile=$folder/log/slurmdbd.log
StorageType=accounting_storage/mysql
StorageHost=127.0.0.1
StoragePort=26820
StorageUser=slurm
StoragePass=$password
END
    chmod 600 "$folder/slurmdbd.conf"
    cat > "$SLURM_CONF" << END
$common
SlurmdUser=$(id -un)
ClusterName=local
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmctldPort=26817
SlurmdPort=26818
SlurmctldPidFile=$folder/slurmctld.own.pid
SlurmdPidFile=$folder/slurmd.own.pid
SlurmctldLogFile=$folder/log/slurmctld.log
SlurmdLogFile=$folder/log/slurmd.log
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
ReturnToService=2
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
AccountingStorageType=accounting_storage/slurmdbd
AccountingStorageHost=localhost
AccountingStoragePort=26819
AccountingStoragePass=$folder/munge.socket
JobAcctGatherType=jobacct_gather/linux
$(slurmd -C | head -n 1 | sed 's/^NodeName=[^ ]*/NodeName='"$(hostname -s)"' NodeAddr=127.0.0.1/') State=UNKNOWN
PartitionName=local Nodes=ALL Default=YES MaxTime=INFINITE State=UP
END
}

node_is_idle() {
    [ "$(sinfo --noheader --format=%t)" = idle ]
}

# start PROGRAM ARGUMENTS...: in the background, its process id in FOLDER/PROGRAM.pid
start() {
    setsid "$@" >> "$folder/log/$1.out" 2>&1 < /dev/null &
    echo $! > "$folder/$1.pid"
}

# wait_for NAME COMMAND...: until the command succeeds, a minute at most
wait_for() {
    name=$1
    shift
    end=$(($(date +%s) + 60))
    until "$@" > "$folder/log/waiting" 2>&1; do
        [ "$(date +%s)" -lt $end ] || {
            echo "$0: the $name did not come up within a minute: $(tail -n 1 "$folder/log/waiting"); see $folder/log, then end" \
                "what runs with: $0 down $folder" >&2
            exit 1
        }
        sleep 0.2
    done
}

main "$@"
