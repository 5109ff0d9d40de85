// SPDX-License-Identifier: GPL-2.0-or-later
/* See bench.h. */
#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/sysinfo.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "bench.h"

#define FOLDER "/sys/kernel/config/incise-stepper/bench%u"
#define PAGE 4096
#define AT_ONCE 4096 /* edges that are read at a time */

/*
 * The delay that a step may have behind the profile, beyond 1/8 of a step at full speed, from which
 * on the module puts its time line off, and what a change of direction costs: what the timer
 * was late in virtual time at most (measured 10 us), and again for the edge before.
 */
#define LATE_NS 20000

static const char *const line_names[BENCH_LINES] = {
	"step", "dir", "enable", "limit_min", "limit_max", "home", "fault",
};

int64_t bench_now_ns(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return now.tv_sec * INT64_C(1000000000) + now.tv_nsec;
}

void bench_nap(int64_t ns)
{
	nanosleep(&(struct timespec){.tv_sec = ns / 1000000000,
				     .tv_nsec = ns % 1000000000},
		  NULL);
}

static int put(const struct bench *bench, const char *name, const char *text)
{
	char path[160];
	int fd, ret = 0;

	snprintf(path, sizeof(path), FOLDER "/%s", bench->number, name);
	fd = open(path, O_WRONLY | O_CLOEXEC);
	if (fd < 0)
		return -errno;
	if (write(fd, text, strlen(text)) < 0)
		ret = -errno;
	close(fd);
	return ret;
}

static int get(const struct bench *bench, const char *name, char *text, size_t size)
{
	char path[160];
	ssize_t n;
	int fd;

	snprintf(path, sizeof(path), FOLDER "/%s", bench->number, name);
	fd = open(path, O_RDONLY | O_CLOEXEC);
	n = fd < 0 ? -1 : read(fd, text, size - 1);
	if (fd >= 0)
		close(fd);
	if (n < 1)
		return -ENODATA;
	text[n - 1] = '\0';
	return 0;
}

static int wire(const struct bench *bench, const char *name, unsigned int line, bool low)
{
	char text[64];

	snprintf(text, sizeof(text), INCISE_SIM_LABEL ":%u%s", line,
		 low ? ":active-low" : "");
	return put(bench, name, text);
}

static int wire_motor(const struct bench *bench, unsigned int motor, unsigned int n_lines)
{
	const unsigned int chip_motor = bench->number * INCISE_STEPPER_MOTORS_MAX + motor;
	char name[160];
	int ret = 0;

	snprintf(name, sizeof(name), FOLDER "/motor%u", bench->number, motor);
	if (mkdir(name, 0755) && errno != EEXIST)
		return -errno;
	for (unsigned int i = 0; i < n_lines && !ret; i++) {
		snprintf(name, sizeof(name), "motor%u/%s", motor, line_names[i]);
		ret = wire(bench, name, bench_line(chip_motor, i), i == BENCH_ENABLE);
	}
	return ret;
}

int bench_name(struct bench *bench)
{
	char text[64];
	int ret = get(bench, "cdev", text, sizeof(text));

	if (ret)
		return ret;
	snprintf(bench->cdev, sizeof(bench->cdev), "/dev/%.50s", text);
	return get(bench, "dev_name", bench->dev_name, sizeof(bench->dev_name));
}

static int bind_wires(struct bench *bench, unsigned int n_motors, unsigned int n_lines)
{
	char path[160];
	int ret = 0;

	bench->n_motors = n_motors;
	bench->fd = -1;
	snprintf(path, sizeof(path), FOLDER, bench->number);
	if (mkdir(path, 0755) && errno != EEXIST)
		return -errno;
	for (unsigned int i = 0; i < n_motors && !ret; i++)
		ret = wire_motor(bench, i, n_lines);
	if (!ret && n_lines == BENCH_LINES) {
		ret = wire(bench, "estop", BENCH_ESTOP, true);
		ret = ret ? ret : wire(bench, "sync", BENCH_SYNC, false);
	}
	ret = ret ? ret : put(bench, "live", "1");
	return ret ? ret : bench_name(bench);
}

int bench_bind(struct bench *bench, unsigned int n_motors)
{
	int ret;

	memset(bench, 0, sizeof(*bench));
	/* All inputs inactive, e-stop is so when it is high. */
	simulator_write("scripts", "clear");
	simulator_write("carriage", "off");
	for (unsigned int i = 0; i <= BENCH_SYNC; i++)
		simulator_write("inputs", "%u %d", i, i == BENCH_ESTOP);
	ret = bind_wires(bench, n_motors, BENCH_LINES);
	/* What binding did to the lines is not a motion. */
	simulator_write("edges", "reset");
	return ret;
}

int bench_bind_bare(struct bench *bench, unsigned int number, unsigned int n_motors)
{
	memset(bench, 0, sizeof(*bench));
	bench->number = number;
	return bind_wires(bench, n_motors, BENCH_ENABLE + 1);
}

int bench_unbind(struct bench *bench)
{
	char path[160];
	int ret = put(bench, "live", "0");

	/* It never went live: only its folders are left. */
	if (ret == -EPERM)
		ret = 0;
	for (unsigned int i = 0; i < bench->n_motors && !ret; i++) {
		snprintf(path, sizeof(path), FOLDER "/motor%u", bench->number, i);
		ret = rmdir(path) ? -errno : 0;
	}
	snprintf(path, sizeof(path), FOLDER, bench->number);
	return ret ? ret : rmdir(path) ? -errno : 0;
}

int bench_open(struct bench *bench)
{
	void *page;

	bench->fd = open(bench->cdev, O_RDWR | O_CLOEXEC | O_NONBLOCK);
	if (bench->fd < 0)
		return -errno;
	page = mmap(NULL, PAGE, PROT_READ | PROT_WRITE, MAP_SHARED, bench->fd,
		    INCISE_STEPPER_PAGE_SETPOINTS * PAGE);
	if (page == MAP_FAILED)
		return -errno;
	bench->setpoint = page;
	page = mmap(NULL, PAGE, PROT_READ, MAP_SHARED, bench->fd,
		    INCISE_STEPPER_PAGE_STATUS * PAGE);
	if (page == MAP_FAILED)
		return -errno;
	bench->status = page;
	return ioctl(bench->fd, INCISE_STEPPER_GET_INFO, &bench->info) ? -errno : 0;
}

void bench_close(struct bench *bench)
{
	if (bench->fd < 0)
		return;
	munmap((void *)bench->setpoint, PAGE);
	munmap((void *)bench->status, PAGE);
	close(bench->fd);
	bench->fd = -1;
}

int bench_command(const struct bench *bench, unsigned long request, uint32_t mask)
{
	return ioctl(bench->fd, request, &mask) ? -errno : 0;
}

/* Levels of step, dir, enable as the chip has them now. */
static unsigned int levels_now(unsigned int motor)
{
	char text[16384], *at;
	unsigned int levels = 0, line;
	FILE *file = fopen(INCISE_SIM_DIR "/inputs", "r");
	size_t n = file ? fread(text, 1, sizeof(text) - 1, file) : 0;

	if (file)
		fclose(file);
	text[n] = '\0';
	for (at = text; *at; at = strchr(at, '\n') + 1) {
		char way[8];
		int level;

		if (sscanf(at, "%u %7s %d", &line, way, &level) == 3 &&
		    line - bench_line(motor, 0) < 3)
			levels |= (unsigned int)level << (line - bench_line(motor, 0));
		if (!strchr(at, '\n'))
			break;
	}
	return levels;
}

int bench_configure(struct bench *bench, const struct incise_stepper_config *config,
		    int64_t position)
{
	const unsigned int m = config->motor;
	const bool invert = config->flags & INCISE_STEPPER_CONFIG_INVERT;
	struct incise_stepper_origin origin = {
		.motor = m, .homed = 1, .position = position};
	const bool timed = !strcmp(getenv("INCISE_VM_PROFILE") ?: "", "deterministic");
	/* An eighth of a step, and what a firing costs. */
	const int64_t eighth_ns = INT64_C(125000000) / config->velocity + 1;
	const int64_t firing_ns = bench->info.step_ns / 2;
	const int64_t catch_ns = eighth_ns + firing_ns;
	struct edge_log_motor motor = {
		.step = bench_line(m, BENCH_STEP),
		.dir = bench_line(m, BENCH_DIR),
		.enable = bench_line(m, BENCH_ENABLE),
		.enable_low = true,
		.dir_low = invert,
		.high_ns = config->high_ns,
		.low_ns = config->low_ns,
		.setup_ns = config->setup_ns,
		.hold_ns = config->hold_ns,
		.enable_ns = config->enable_ns,
		.velocity = config->velocity,
		.catch_ns = catch_ns,
		.acceleration = config->acceleration,
		.tick_ns = config->tick_ns,
		.lateness_ns =
			timed ? catch_ns + config->setup_ns + config->hold_ns + LATE_NS
			      : -1,
		.position_min = config->position_min,
		.position_max = config->position_max,
		.stop = {{true, bench_line(m, BENCH_MIN), false, -1, 0},
			 {true, bench_line(m, BENCH_MAX), false, 1, 0},
			 {true, BENCH_ESTOP, true, 0, 0},
			 {true, bench_line(m, BENCH_FAULT), false, 0, 0}},
	};

	if (ioctl(bench->fd, INCISE_STEPPER_SET_CONFIG, config) ||
	    ioctl(bench->fd, INCISE_STEPPER_SET_POSITION, &origin))
		return -errno;
	bench_judge(bench);
	bench->config[m] = *config;
	if (bench->log[m].begun) {
		edge_log_limits(&bench->log[m], &motor);
		bench->log[m].position = position;
		bench->log[m].dir_on = (levels_now(m) >> 1 & 1) != invert;
	} else {
		edge_log_init(&bench->log[m], &motor, position, levels_now(m));
	}
	return 0;
}

int bench_carriage(const struct incise_stepper_config *config, int64_t position,
		   const char *more)
{
	const unsigned int m = config->motor;

	return simulator_write("carriage",
			       "number=%u step=%u dir=%u enable=%u min=%u max=%u home=%u "
			       "position=%lld inverted=enable%s %s",
			       m, bench_line(m, BENCH_STEP), bench_line(m, BENCH_DIR),
			       bench_line(m, BENCH_ENABLE), bench_line(m, BENCH_MIN),
			       bench_line(m, BENCH_MAX), bench_line(m, BENCH_HOME),
			       (long long)position,
			       config->flags & INCISE_STEPPER_CONFIG_INVERT ? ",dir" : "",
			       more);
}

void bench_want(struct bench *bench, unsigned int motor, unsigned int mode,
		int64_t target)
{
	volatile struct incise_stepper_setpoint *slot = &bench->setpoint[motor];
	uint32_t seq = slot->seq;

	slot->seq = seq + 1;
	__atomic_thread_fence(__ATOMIC_SEQ_CST);
	slot->mode = mode;
	slot->target = target;
	slot->t_ns = bench_now_ns();
	__atomic_thread_fence(__ATOMIC_SEQ_CST);
	slot->seq = seq + 2;
}

struct incise_stepper_motor_status bench_look(const struct bench *bench,
					      unsigned int motor)
{
	const volatile struct incise_stepper_motor_status *slot = &bench->status[motor];
	struct incise_stepper_motor_status copy;
	uint32_t seq;

	do {
		seq = slot->seq;
		__atomic_thread_fence(__ATOMIC_SEQ_CST);
		copy = *slot;
		__atomic_thread_fence(__ATOMIC_SEQ_CST);
	} while (seq & 1 || seq != slot->seq);
	return copy;
}

bool bench_rest(struct bench *bench, unsigned int motors)
{
	const uint32_t at_rest =
		1U << INCISE_STEPPER_STATE_FAULT | 1U << INCISE_STEPPER_STATE_DISABLED;
	const uint32_t all = (1U << motors) - 1;
	int64_t end_ns = bench_now_ns() + INT64_C(60000000000);
	bool rest;

	do {
		rest = true;
		bench_command(bench, INCISE_STEPPER_DISABLE, all);
		bench_nap(1000000);
		for (unsigned int i = 0; i < motors; i++)
			rest &= at_rest >> bench_look(bench, i).state & 1;
	} while (!rest && bench_now_ns() < end_ns);
	bench_command(bench, INCISE_STEPPER_CLEAR, all);
	return rest;
}

void bench_judge(struct bench *bench)
{
	static struct incise_sim_edge edge[AT_ONCE];
	long n;

	while ((n = simulator_edges(edge, AT_ONCE)) > 0) {
		for (unsigned int i = 0; i < bench->n_motors; i++)
			edge_log_take(&bench->log[i], edge, n);
		bench->edges += n;
		if (n < AT_ONCE)
			break;
	}
}

uint64_t bench_faulty(const struct bench *bench)
{
	uint64_t sum = 0;

	for (unsigned int i = 0; i < bench->n_motors; i++) {
		const struct edge_log *log = &bench->log[i];

		sum += log->faulty;
		if (!log->faulty)
			continue;
		printf("# motor %u: %s\n#", i, log->first);
		for (unsigned int f = 0; f < EDGE_LOG_FAULTS; f++)
			if (log->faults[f])
				printf(" %s %llu", edge_log_name(f),
				       (unsigned long long)log->faults[f]);
		printf("\n");
	}
	return sum;
}

bool bench_until(struct bench *bench, unsigned int motor, uint32_t states,
		 unsigned int mode, int64_t target, int64_t ns)
{
	int64_t end = bench_now_ns() + ns;

	/* Two looks, with a tick between: the first may be of before the last set-point. */
	for (int seen = 0; seen < 2;) {
		bench_want(bench, motor, mode, target);
		bench_nap(bench->config[motor].tick_ns + 500000);
		seen = states & 1U << bench_look(bench, motor).state ? seen + 1 : 0;
		if (bench_now_ns() > end)
			return false;
	}
	return true;
}

pid_t bench_take_memory(void)
{
	pid_t pid = fork();
	struct sysinfo info;

	if (!pid) {
		sched_setscheduler(0, SCHED_OTHER, &(struct sched_param){0});
		sysinfo(&info);
		if (mmap(NULL, info.freeram / 10 * 9 * info.mem_unit,
			 PROT_READ | PROT_WRITE,
			 MAP_PRIVATE | MAP_ANONYMOUS | MAP_POPULATE, -1, 0) != MAP_FAILED)
			raise(SIGSTOP);
		_exit(1);
	}
	waitpid(pid, NULL, WUNTRACED);
	return pid;
}
