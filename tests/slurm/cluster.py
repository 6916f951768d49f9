"""A Slurm cluster of virtual nodes on this machine, without systemd or cgroups, in a folder of its own."""
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import time
from typing import Any, Callable

CONFIGURATION = """
ClusterName=gonio
SlurmctldHost={host}
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket,cred_expire=5
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool-%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
SlurmctldLogFile={folder}/log/slurmctld.log
SlurmdLogFile={folder}/log/slurmd-%n.log
SlurmctldPort={controller_port}
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerType=sched/backfill
SchedulerParameters=batch_sched_delay=0,sched_min_interval=10000,bf_interval=5
MpiDefault=none
ReturnToService=2
SwitchType=switch/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/none
JobAcctGatherType=jobacct_gather/none
MinJobAge=600
KillWait=5
SlurmdTimeout=5
InactiveLimit=0
JobRequeue=1
SlurmctldTimeout=30
SlurmdParameters=config_overrides
PartitionName=batch Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def free_ports(count: int) -> list[int]:
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [s.getsockname()[1] for s in sockets]
    for s in sockets:
        s.close()
    return ports


def wait_until(what: str, is_true: Callable[[], Any], seconds: float = 180) -> Any:
    """The first true answer. The limit is for what never comes, not a measure."""
    end = time.monotonic() + seconds
    while not (answer := is_true()):
        if time.monotonic() > end:
            raise AssertionError(f"waited {seconds:.0f} s in vain until {what}")
        time.sleep(0.1)
    return answer


class Cluster:
    """With `with`: everything is stopped afterwards, whatever happened."""

    def __init__(self, folder: pathlib.Path, n_nodes: int = 4) -> None:
        self.folder = folder
        self.nodes = [f"v{i + 1}" for i in range(n_nodes)]
        self.daemons: dict[str, subprocess.Popen[bytes]] = {}
        self.environment = dict(os.environ, SLURM_CONF=str(folder / "slurm.conf"))

    def __enter__(self) -> "Cluster":
        try:
            self._start()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        if "munged" in self.daemons and "slurmctld" in self.daemons:
            subprocess.run(["scancel", "--user=root"], env=self.environment, check=False, timeout=60, capture_output=True)
        for name in reversed(list(self.daemons)):
            self.kill(name)
        for pid in self._processes_of_tasks():
            kill(pid)

    def _start(self) -> None:
        for name in ("state", "log"):
            (self.folder / name).mkdir()
        key = self.folder / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        controller_port, *ports = free_ports(1 + len(self.nodes))
        host = socket.gethostname().split(".")[0]
        nodes = "".join(f"NodeName={node} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=1 RealMemory=1000 State=UNKNOWN\n"
                        for node, port in zip(self.nodes, ports))
        text = CONFIGURATION.format(host=host, folder=self.folder, controller_port=controller_port)
        (self.folder / "slurm.conf").write_text(text.replace("PartitionName", nodes + "PartitionName"), encoding="utf-8")
        self._daemon("munged", "--foreground", "--force", f"--socket={self.folder}/munge.socket", f"--key-file={key}",
                     f"--pid-file={self.folder}/munged.pid", f"--seed-file={self.folder}/munged.seed",
                     f"--log-file={self.folder}/log/munged.log")
        wait_until("munged listens", (self.folder / "munge.socket").exists, 60)
        self.start_controller()
        for node in self.nodes:
            self.start_node(node)
        wait_until("all nodes are idle", lambda: self.node_states() == {node: "idle" for node in self.nodes}, 120)

    def _daemon(self, name: str, *arguments: str) -> None:
        program = name.split("-")[0]
        with open(self.folder / "log" / f"{name}.out", "ab") as out:
            self.daemons[name] = subprocess.Popen([shutil.which(program, path="/usr/sbin:/usr/bin") or program, *arguments],
                                                  env=self.environment, stdin=subprocess.DEVNULL, stdout=out, stderr=out)

    def start_controller(self) -> None:
        self._daemon("slurmctld", "-D")
        wait_until("slurmctld answers", lambda: self.ask("scontrol", "ping").returncode == 0, 120)

    def start_node(self, node: str) -> None:
        self._daemon(f"slurmd-{node}", "-D", "-N", node)

    def kill(self, name: str) -> None:
        """kill -9 of a daemon."""
        daemon = self.daemons.pop(name)
        daemon.kill()
        daemon.wait()

    def kill_node(self, node: str) -> None:
        """kill -9 of slurmd and of all that runs on the node, as a power cut would."""
        self.kill(f"slurmd-{node}")
        for pid in self._processes_of_tasks(node):
            kill(pid)

    def ask(self, *command: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(command, env=self.environment, text=True, capture_output=True, timeout=60, check=False)

    def node_states(self) -> dict[str, str]:
        lines = self.ask("sinfo", "--Node", "--noheader", "--format=%N %t").stdout.split("\n")
        return dict(line.split() for line in lines if line)

    def tasks(self) -> list[dict[str, Any]]:
        """Array tasks that are not over, as squeue lists them: array_job_id, array_task_id, state, node, name."""
        lines = self.ask("squeue", "--noheader", "--array", "--format=%F|%K|%T|%N|%j").stdout.split("\n")
        keys = ("array_job_id", "array_task_id", "state", "node", "name")
        return [dict(zip(keys, line.split("|"))) for line in lines if line]

    def _processes_of_tasks(self, node: str = "") -> list[int]:
        """Everything that slurmd started for tasks, their slurmstepd included."""
        marks = [f"SLURMD_NODENAME={n}".encode() for n in ([node] if node else self.nodes)]
        conf = f"SLURM_CONF={self.folder}/".encode()
        found = set()
        for entry in pathlib.Path("/proc").iterdir():
            if not entry.name.isdigit():
                continue
            try:
                environment = (entry / "environ").read_bytes().split(b"\0")
                if any(mark in environment for mark in marks) and any(e.startswith(conf) for e in environment):
                    found.add(int(entry.name))
                    parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
                    if pathlib.Path(f"/proc/{parent}/comm").read_text().startswith("slurmstepd"):
                        found.add(parent)
            except (OSError, ValueError):  # it has just ended
                continue
        return sorted(found)


def kill(pid: int) -> None:
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
