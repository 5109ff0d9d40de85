// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The guarantees of the stepper module, one after the other, on the simulated chip:
 *
 *   stepper_smoke /dev/incise-stepperN DRIVER_DIR DEVICE
 *
 * Lines of the chip: step 0, dir 1, enable 2, limits 3 and 4, home 5, fault 6, e-stop 7,
 * SYNC 8. Prints "ok …" and "not ok …".
 */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "../../clock.h"
#include "../../../driver/sim/incise_sim.h"
#include "../../../driver/uapi/incise_stepper.h"

#define PAGE 4096
#define EDGES_MAX 65536

struct bench {
	int fd;
	struct incise_stepper_setpoint *slot;
	const struct incise_stepper_motor_status *status;
};

static void report(bool good, const char *what)
{
	printf("%sok %s\n", good ? "" : "not ", what);
}

static void nap(long us)
{
	nanosleep(&(struct timespec){.tv_nsec = us * 1000}, NULL);
}

static bool write_text(const char *path, const char *text)
{
	int fd = open(path, O_WRONLY | O_CLOEXEC);
	bool good = fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text);

	if (fd >= 0)
		close(fd);
	return good;
}

static bool drive(const char *what)
{
	return write_text(INCISE_SIM_DIR "/inputs", what);
}

static bool bench_open(struct bench *bench, const char *path)
{
	bench->fd = open(path, O_RDWR | O_CLOEXEC);
	if (bench->fd < 0)
		return false;
	bench->slot = mmap(NULL, PAGE, PROT_READ | PROT_WRITE, MAP_SHARED, bench->fd, 0);
	bench->status = mmap(NULL, PAGE, PROT_READ, MAP_SHARED, bench->fd, PAGE);
	return bench->slot != MAP_FAILED && bench->status != MAP_FAILED;
}

static void bench_close(struct bench *bench)
{
	munmap(bench->slot, PAGE);
	munmap((void *)bench->status, PAGE);
	close(bench->fd);
}

static struct incise_stepper_motor_status look(const struct bench *bench)
{
	struct incise_stepper_motor_status copy;
	uint32_t seq;

	do {
		seq = __atomic_load_n(&bench->status->seq, __ATOMIC_ACQUIRE);
		copy = *(const volatile struct incise_stepper_motor_status *)
				bench->status;
		__atomic_thread_fence(__ATOMIC_ACQUIRE);
	} while (seq & 1 ||
		 seq != __atomic_load_n(&bench->status->seq, __ATOMIC_RELAXED));
	return copy;
}

static void want(struct bench *bench, unsigned int mode, int64_t target)
{
	volatile struct incise_stepper_setpoint *slot = bench->slot;
	uint32_t seq = slot->seq;

	slot->seq = seq + 1;
	__atomic_thread_fence(__ATOMIC_SEQ_CST);
	slot->mode = mode;
	slot->target = target;
	slot->t_ns = now_ns();
	__atomic_thread_fence(__ATOMIC_SEQ_CST);
	slot->seq = seq + 2;
}

static int command(const struct bench *bench, unsigned long request, uint32_t mask)
{
	return ioctl(bench->fd, request, &mask) ? -errno : 0;
}

/* Until the motor is in a state, with signs of life; false after 10 s. */
static bool until(struct bench *bench, uint32_t state, unsigned int mode, int64_t target,
		  bool alive)
{
	int64_t end = now_ns() + INT64_C(10000000000);

	while (look(bench).state != state) {
		if (now_ns() > end)
			return false;
		if (alive)
			want(bench, mode, target);
		nap(500);
	}
	return true;
}

/* Go somewhere and be there, on a machine of any speed. */
static bool go(struct bench *bench, int64_t target)
{
	int64_t end = now_ns() + INT64_C(60000000000);
	struct incise_stepper_motor_status status;

	do {
		want(bench, INCISE_STEPPER_MODE_POSITION, target);
		nap(500);
		status = look(bench);
		if (now_ns() > end || status.state == INCISE_STEPPER_STATE_FAULT)
			return false;
	} while (status.position != target || status.state != INCISE_STEPPER_STATE_READY);
	return true;
}

static bool fresh(struct bench *bench)
{
	command(bench, INCISE_STEPPER_CLEAR, 1);
	return command(bench, INCISE_STEPPER_ENABLE, 1) == 0;
}

/* Move away at 2000 steps/s and see it moving. */
static bool run(struct bench *bench, int64_t velocity)
{
	struct incise_stepper_motor_status status = {0};

	for (int i = 0; i < 100; i++) {
		want(bench, INCISE_STEPPER_MODE_VELOCITY, velocity);
		nap(500);
		status = look(bench);
	}
	return status.state == INCISE_STEPPER_STATE_MOVING;
}

static size_t read_edges(struct incise_sim_edge *edges, size_t n)
{
	int fd = open(INCISE_SIM_DIR "/edges", O_RDONLY | O_CLOEXEC);
	size_t done = 0;
	ssize_t got = 1;

	while (fd >= 0 && got > 0 && done < n) {
		got = read(fd, edges + done, (n - done) * sizeof(*edges));
		if (got > 0)
			done += (size_t)got / sizeof(*edges);
	}
	if (fd >= 0)
		close(fd);
	return done;
}

/* 1000 steps up and back: counted edges, and none shorter than the config says. */
static void try_edges(struct bench *bench, const struct incise_stepper_config *config,
		      const struct incise_stepper_controller *info)
{
	static struct incise_sim_edge edges[EDGES_MAX];
	int64_t lead = 0, trail = 0, dir = 0, up = 0, down = 0, shorts = 0;
	/* A late step may be caught up by an eighth, and by what a firing costs. */
	int64_t interval = 875000000 / config->velocity - info->step_ns / 2;
	bool level = false;
	size_t n;

	write_text(INCISE_SIM_DIR "/edges", "reset");
	report(go(bench, 1000) && look(bench).steps_up == 1000, "1000 steps up, exactly");
	report(go(bench, 0) && look(bench).steps_down == 1000, "and 1000 back");
	n = read_edges(edges, EDGES_MAX);
	for (size_t i = 0; i < n; i++) {
		int64_t t = edges[i].t_ns;

		if (edges[i].line == 1) {
			level = edges[i].value;
			shorts += lead && t - lead < config->hold_ns;
			dir = t;
		} else if (edges[i].line == 0 && edges[i].value) {
			up += level;
			down += !level;
			shorts += trail && t - trail < config->low_ns;
			shorts += lead && t - lead < interval;
			shorts += dir && t - dir < config->setup_ns;
			lead = t;
		} else if (edges[i].line == 0) {
			shorts += t - lead < config->high_ns;
			trail = t;
		}
	}
	report(up == 1000 && down == 1000, "as many edges with the right direction");
	report(!shorts, "no time of an edge is below its limit");
	if (shorts)
		printf("# %lld of %zu edges\n", (long long)shorts, n);
}

#define TRACE "/sys/kernel/tracing/"

/* One line of the trace for each edge, with times that make sense. */
static void try_trace(struct bench *bench)
{
	int leads = 0, trails = 0, backwards = 0, motor;
	char line[512];
	FILE *trace;

	write_text(TRACE "trace", "\n");
	report(write_text(TRACE "events/incise_stepper/enable", "1"), "tracepoints");
	go(bench, 10);
	write_text(TRACE "events/incise_stepper/enable", "0");
	trace = fopen(TRACE "trace", "r");
	while (trace && fgets(line, sizeof(line), trace)) {
		long long due, actual;
		char *at = strstr(line, "controller=");
		unsigned int value;
		char name[16];

		if (!at ||
		    sscanf(at,
			   "controller=%*d motor=%d line=%15s value=%u due_ns=%lld "
			   "actual_ns=%lld",
			   &motor, name, &value, &due, &actual) != 5)
			continue;
		leads += !strcmp(name, "step") && value;
		trails += !strcmp(name, "step") && !value;
		backwards += actual < due;
	}
	if (trace)
		fclose(trace);
	report(leads == 10 && trails == 10, "an event for each edge");
	report(!backwards, "no edge before it was due");
	report(go(bench, 0), "and back");
}

static void try_deadman(struct bench *bench)
{
	int64_t begin;

	report(run(bench, 2000), "it runs");
	begin = now_ns();
	report(until(bench, INCISE_STEPPER_STATE_FAULT, 0, 0, false) &&
		       look(bench).faults == INCISE_STEPPER_FAULT_DEADMAN,
	       "deadman: it stops with that fault");
	printf("# %lld us after the last set-point\n",
	       (long long)(now_ns() - begin) / 1000);
	report(command(bench, INCISE_STEPPER_ENABLE, 1) == -ENOTRECOVERABLE,
	       "no power while a fault is latched");
	report(command(bench, INCISE_STEPPER_CLEAR, 1) == 0 &&
		       look(bench).state == INCISE_STEPPER_STATE_DISABLED,
	       "clear leaves it disabled");
}

static void try_limit(struct bench *bench)
{
	struct incise_stepper_motor_status status;
	int64_t stop;

	report(fresh(bench) && run(bench, 2000), "it runs up");
	drive("4 1");
	nap(2000);
	status = look(bench);
	stop = status.position;
	report(status.state == INCISE_STEPPER_STATE_FAULT &&
		       status.faults == INCISE_STEPPER_FAULT_LIMIT_MAX &&
		       status.inputs == INCISE_STEPPER_LINE_LIMIT_MAX,
	       "the upper limit stops it");
	report(!(status.flags & INCISE_STEPPER_FLAG_HOMED),
	       "a stop at once is no longer homed");
	fresh(bench);
	report(!go(bench, stop + 10) && look(bench).position == stop,
	       "no step towards a limit that is active");
	report(fresh(bench) && go(bench, stop - 10), "steps away from it");
	drive("4 0");
	command(bench, INCISE_STEPPER_DISABLE, 1);
	report(until(bench, INCISE_STEPPER_STATE_DISABLED, 0, 0, false), "disable");
}

static void try_estop(struct bench *bench)
{
	report(fresh(bench) && run(bench, -2000), "it runs down");
	drive("7 1");
	nap(2000);
	report(look(bench).faults == INCISE_STEPPER_FAULT_ESTOP, "e-stop");
	report(command(bench, INCISE_STEPPER_CLEAR, 1) == -EBUSY,
	       "no clear while it is pressed");
	drive("7 0");
	report(command(bench, INCISE_STEPPER_CLEAR, 1) == 0, "clear after it");
	drive("6 1");
	nap(1000);
	report(command(bench, INCISE_STEPPER_ENABLE, 1) == -EBUSY,
	       "no power while the power stage reports a fault");
	drive("6 0");
}

static void try_home(struct bench *bench)
{
	struct incise_stepper_motor_status status;
	struct incise_stepper_origin origin = {.homed = 1, .position = 100};

	report(fresh(bench) && run(bench, 1000), "it runs");
	drive("5 1");
	until(bench, INCISE_STEPPER_STATE_READY, INCISE_STEPPER_MODE_VELOCITY, 0, true);
	status = look(bench);
	report(status.flags & INCISE_STEPPER_FLAG_HOME_SEEN &&
		       status.home_position < status.position,
	       "the home edge has its position");
	report(!ioctl(bench->fd, INCISE_STEPPER_SET_POSITION, &origin) &&
		       look(bench).position == 100 &&
		       look(bench).flags & INCISE_STEPPER_FLAG_HOMED,
	       "a new origin");
	report(go(bench, 0), "and it goes to 0 there");
	drive("5 0");
}

static void try_garbage(struct bench *bench)
{
	report(fresh(bench), "enable");
	bench->slot->reserved[3] = 1;
	want(bench, INCISE_STEPPER_MODE_POSITION, 10);
	report(until(bench, INCISE_STEPPER_STATE_FAULT, 0, 0, false) &&
		       look(bench).faults == INCISE_STEPPER_FAULT_SETPOINT,
	       "garbage in the page is a fault");
	bench->slot->reserved[3] = 0;
}

static void try_abi(struct bench *bench, const char *path)
{
	struct incise_stepper_config config = {.reserved = {1}};
	int watcher = open(path, O_RDONLY | O_CLOEXEC);
	uint32_t mask = 1;

	report(open(path, O_RDWR) < 0 && errno == EBUSY, "a second owner is refused");
	report(ioctl(bench->fd, _IO(INCISE_STEPPER_IOC, 99)) < 0 && errno == ENOTTY,
	       "an unknown ioctl");
	report(ioctl(bench->fd, INCISE_STEPPER_SET_CONFIG, &config) < 0 &&
		       errno == EINVAL,
	       "a reserved field that is not zero");
	report(ioctl(watcher, INCISE_STEPPER_ENABLE, &mask) < 0 && errno == EPERM,
	       "a watcher cannot enable");
	report(!ioctl(watcher, INCISE_STEPPER_DISABLE, &mask), "it can stop a motor");
	report(mmap(NULL, PAGE, PROT_READ, MAP_SHARED, watcher, 0) == MAP_FAILED &&
		       errno == EPERM,
	       "nor see the set-points");
	report(mmap(NULL, PAGE, PROT_READ, MAP_SHARED, watcher, PAGE) != MAP_FAILED,
	       "it sees the status");
	report(mmap(NULL, PAGE, PROT_READ | PROT_WRITE, MAP_SHARED, bench->fd, PAGE) ==
			       MAP_FAILED &&
		       errno == EACCES,
	       "the status page is read-only");
	report(mprotect((void *)bench->status, PAGE, PROT_READ | PROT_WRITE) < 0,
	       "and stays so");
	report(mmap(NULL, 2 * PAGE, PROT_READ, MAP_SHARED, bench->fd, PAGE) ==
			       MAP_FAILED &&
		       errno == EINVAL,
	       "one page, no more");
	close(watcher);
}

static void try_events(struct bench *bench)
{
	struct incise_stepper_event event[256];
	ssize_t n = read(bench->fd, event, sizeof(event));
	bool order = n > 0;

	for (ssize_t i = 1; i < n / (ssize_t)sizeof(*event); i++)
		order = order && event[i].seq == event[i - 1].seq + 1 &&
			event[i].t_ns >= event[i - 1].t_ns;
	report(order, "events in order");
	printf("# %zd events\n", n / (ssize_t)sizeof(*event));
}

static void try_sync(struct bench *bench)
{
	struct incise_stepper_sync sync = {.period_ns = 1000000, .width_ns = 10000};
	struct pollfd waiting = {.fd = bench->fd, .events = POLLIN};
	struct incise_stepper_event event[32];
	bool beat = true;
	int seen = 0;

	report(!ioctl(bench->fd, INCISE_STEPPER_SET_SYNC, &sync), "SYNC at 1 kHz");
	while (seen < 100 && poll(&waiting, 1, 1000) == 1) {
		ssize_t n = read(bench->fd, event, sizeof(event));

		for (ssize_t i = 0; i < n / (ssize_t)sizeof(*event); i++)
			if (event[i].type == INCISE_STEPPER_EVENT_SYNC)
				beat = beat && event[i].position == ++seen;
	}
	ioctl(bench->fd, INCISE_STEPPER_GET_SYNC, &sync);
	report(seen >= 100 && beat, "each pulse is an event with its number");
	report(sync.last_ns - sync.first_ns >=
		       (int64_t)(sync.pulses + sync.missed - 1) * 1000000,
	       "pulses keep their beat");
	sync = (struct incise_stepper_sync){0};
	report(!ioctl(bench->fd, INCISE_STEPPER_SET_SYNC, &sync), "SYNC off");
}

/* The owner stops to speak: a homed motor goes to its safe place, then has no power. */
static void try_retract(struct bench *bench)
{
	struct incise_stepper_config config = {0};
	struct incise_stepper_origin origin = {.homed = 1, .position = 0};
	struct incise_stepper_motor_status status;

	command(bench, INCISE_STEPPER_CLEAR, 1);
	ioctl(bench->fd, INCISE_STEPPER_GET_CONFIG, &config);
	config.flags |= INCISE_STEPPER_CONFIG_RETRACT;
	config.safe_position = -20;
	report(!ioctl(bench->fd, INCISE_STEPPER_SET_CONFIG, &config) &&
		       !ioctl(bench->fd, INCISE_STEPPER_SET_POSITION, &origin),
	       "a safe position");
	report(fresh(bench) && go(bench, 100), "it goes elsewhere");
	until(bench, INCISE_STEPPER_STATE_FAULT, 0, 0, false);
	status = look(bench);
	report(status.faults == INCISE_STEPPER_FAULT_DEADMAN && status.position == -20,
	       "deadman: homed, it goes to the safe position");
	report(status.flags & INCISE_STEPPER_FLAG_HOMED, "and is homed still");
	config.flags &= ~INCISE_STEPPER_CONFIG_RETRACT;
	ioctl(bench->fd, INCISE_STEPPER_SET_CONFIG, &config);
}

/* Killed while it moves: the next owner finds the motor stopped, and why. */
static void try_kill(struct bench *bench, const char *path)
{
	pid_t child;

	bench_close(bench);
	child = fork();
	if (!child) {
		if (bench_open(bench, path) && fresh(bench))
			for (;;)
				run(bench, 2000);
		_exit(1);
	}
	nap(200000);
	kill(child, SIGKILL);
	waitpid(child, NULL, 0);
	report(bench_open(bench, path), "the owner is killed; the next one opens");
	report(until(bench, INCISE_STEPPER_STATE_FAULT, 0, 0, false) &&
		       look(bench).faults & INCISE_STEPPER_FAULT_OWNER,
	       "the motor has stopped with that fault");
}

static void try_unbind(struct bench *bench, const char *driver, const char *device)
{
	struct pollfd hung = {.fd = bench->fd, .events = POLLIN};
	struct incise_stepper_controller info;
	char path[256];

	report(fresh(bench) && run(bench, 2000), "it runs");
	snprintf(path, sizeof(path), "%s/unbind", driver);
	report(write_text(path, device), "unbound while it moves");
	report(ioctl(bench->fd, INCISE_STEPPER_GET_INFO, &info) < 0 && errno == ENODEV,
	       "calls give ENODEV");
	report(poll(&hung, 1, 0) == 1 && hung.revents & POLLHUP, "poll tells HUP");
	report(look(bench).faults & INCISE_STEPPER_FAULT_GONE, "the status says why");
	bench->slot->target = 5;
	report(bench->slot->target == 5, "the pages stay memory");
	bench_close(bench);
	snprintf(path, sizeof(path), "%s/bind", driver);
	report(write_text(path, device), "bound again");
}

int main(int argc, char **argv)
{
	struct incise_stepper_config config = {0};
	struct incise_stepper_controller info;
	struct bench bench;

	if (argc != 4)
		return 2;
	setbuf(stdout, NULL);
	report(bench_open(&bench, argv[1]), "open and map");
	report(!ioctl(bench.fd, INCISE_STEPPER_GET_INFO, &info) && info.n_motors == 1 &&
		       info.rate_max,
	       "info");
	printf("# rate_max %u /s, pulse %u ns, edge %u ns, lateness %u ns, %u at most\n",
	       info.rate_max, info.pulse_ns, info.edge_ns, info.lateness_ns,
	       info.lateness_max_ns);
	report(!ioctl(bench.fd, INCISE_STEPPER_GET_CONFIG, &config) &&
		       !ioctl(bench.fd, INCISE_STEPPER_SET_CONFIG, &config),
	       "the config of the bind is one that may be set");
	/* Slower machines make late edges, not errors: a row of a thousand is none of these. */
	config.late_max = 1000;
	/* Nor shall a host that stops for a while look like an owner that died. */
	config.deadman_ns = 1000000000;
	config.velocity = config.velocity > 5000 ? 5000 : config.velocity;
	report(!ioctl(bench.fd, INCISE_STEPPER_SET_CONFIG, &config), "another config");
	config.velocity = info.rate_max + 1;
	report(ioctl(bench.fd, INCISE_STEPPER_SET_CONFIG, &config) < 0 && errno == ERANGE,
	       "a rate beyond the machine's is refused");
	ioctl(bench.fd, INCISE_STEPPER_GET_CONFIG, &config);
	report(command(&bench, INCISE_STEPPER_ENABLE, 1) == 0, "enable");
	report(ioctl(bench.fd, INCISE_STEPPER_SET_CONFIG, &config) < 0 && errno == EBUSY,
	       "no config while it has power");

	try_edges(&bench, &config, &info);
	try_trace(&bench);
	try_deadman(&bench);
	try_limit(&bench);
	try_estop(&bench);
	try_home(&bench);
	try_garbage(&bench);
	try_abi(&bench, argv[1]);
	try_events(&bench);
	try_sync(&bench);
	try_retract(&bench);
	report(system("rmmod incise_stepper 2>/dev/null") != 0,
	       "the module cannot go while it is open");
	fflush(stdout);
	report(!system("tests/vm/timer_figures"), "the timers' figures can be read");
	try_kill(&bench, argv[1]);
	try_unbind(&bench, argv[2], argv[3]);
	return 0;
}
