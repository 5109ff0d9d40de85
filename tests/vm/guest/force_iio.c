// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A force channel on the simulated converter: a minute at 10 kHz with every sample accounted
 * for, overflows made on purpose, triggers, the clock, and its removal while it runs.
 *
 *   force_iio FILE-OF-incise_sim.ko [hrtimer]
 *
 * Time is asserted on in virtual time only.
 */
#include <errno.h>
#include <fcntl.h>
#include <grp.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "../../clock.h"
#include "../../../lib/rig/backends.h"
#include "../../../lib/device/daq/iio_source.h"
#include "../hold.h"
#include "../simulator.h"
#include "../tap.h"

extern const struct incise_backend incise_force_iio;

#define HZ 10000
#define PERIOD_NS 100000
#define SECONDS 20
#define MANY (HZ * SECONDS)

static struct incise_force_sample samples[MANY + 65536];
static bool virtual_time;

static void nap(int ms)
{
	poll(NULL, 0, ms);
}

static int64_t counted(const char *name)
{
	return simulator_number("adc/status", name);
}

static struct incise_force *open_force(const char *device, const char *trigger,
				       double rate_hz, struct incise_error *err)
{
	struct incise_force_setup setup = {.rate_hz = rate_hz};
	struct incise_backend_request request = {
		.arguments = device, .where = "test: force", .force = &setup};

	*err = (struct incise_error){0};
	snprintf(setup.trigger, sizeof(setup.trigger), "%s", trigger);
	return incise_force_iio.open(&request, err);
}

/* Until there are @n, or none has come for @patience_ms. The last answer is in @rc. */
static int take(struct incise_force *force, int n, int patience_ms, int *rc)
{
	int have = 0, quiet = 0;

	*rc = 0;
	while (have < n && quiet < patience_ms) {
		*rc = incise_force_read(force, samples + have, n - have);
		if (*rc < 0)
			break;
		have += *rc;
		quiet = *rc ? 0 : quiet + 2;
		if (!*rc)
			nap(2);
	}
	return have;
}

static void feed_ramp(void)
{
	static uint16_t ramp[INCISE_SIM_ADC_MAX + 1];

	for (unsigned int i = 0; i <= INCISE_SIM_ADC_MAX; i++)
		ramp[i] = i;
	simulator_write("adc/control", "clear");
	simulator_write("adc/control", "repeat");
	simulator_write_bytes("adc/waveform", ramp, sizeof(ramp));
	simulator_write("adc/control", "reset");
}

/*
 * Samples of @seconds. In virtual time spacing is within 5 us, but where the timer meets another
 * interrupt in that very moment: 7.3 us were seen. It makes one gap long and the next one short.
 * The number depends on the phase of the kernel's tick against the timer: 0 of
 * 600000 and 170 of 100000 were seen. A tick of 250 Hz comes once in 40 gaps, and makes two of
 * them so at most; none is by so much that it could be taken for another. The simulator's trigger counts
 * what it leaves out. The kernel's hrtimer trigger leaves a firing out, and no sample is missing, where
 * the sample before has the processor longer: one in 100000 was seen, never two in a row. All are on the
 * beat of the guest's clock from the first to the last.
 */
#define WITHIN_NS 5000
#define RARE 20
#define NEVER_NS 20000
#define LEFT_OUT 10000
static void all_come(const char *trigger, const char *called, int seconds)
{
	int many = HZ * seconds;
	int64_t least = INT64_MAX, most = 0, far = 0, begin = now_ns(), cpu;
	uint64_t missing = 0, clipped = 0;
	/* each ramp has one code at either end, and the last ramp has begun */
	uint64_t ends = 2 * (uint64_t)(many / 4096) + (many % 4096 != 0);
	int outside = 0, left_out = 0;
	bool codes = true, order = true, clock = true;
	struct incise_force_info info;
	struct incise_force *force;
	struct incise_error err;
	struct timespec used;
	int n, rc;

	feed_ramp();
	force = open_force(INCISE_SIM_ADC, trigger, HZ, &err);
	if (!check(force, "%s: it opens%s%s", called, force ? "" : ": ", err.text))
		return;
	n = take(force, many, 5000, &rc);
	clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
	cpu = used.tv_sec * 1000 + used.tv_nsec / 1000000;
	incise_force_info(force, &info);
	for (int i = 0; i < n; i++) {
		order &= samples[i].seq == (i ? samples[i - 1].seq + 1 : 0);
		missing += i ? samples[i].seq - samples[i - 1].seq - 1 : 0;
		codes &= samples[i].code ==
			 (int32_t)(samples[i].seq % (INCISE_SIM_ADC_MAX + 1));
		clock &= samples[i].t_ns > begin && samples[i].t_ns < now_ns();
		clipped += samples[i].code == 0 || samples[i].code == INCISE_SIM_ADC_MAX;
	}
	for (int i = 1; i < n; i++) {
		int64_t gap = samples[i].t_ns - samples[i - 1].t_ns;
		int64_t off = (samples[i].t_ns - samples[0].t_ns) % PERIOD_NS;

		off = off < PERIOD_NS / 2 ? off : PERIOD_NS - off;
		far = off > far ? off : far;
		left_out += gap > PERIOD_NS + PERIOD_NS / 2;
		least = gap < least ? gap : least;
		most = gap > most ? gap : most;
		outside += gap < PERIOD_NS - WITHIN_NS || gap > PERIOD_NS + WITHIN_NS;
	}
	note("%s: %s, %g Hz, %d bits, %g V from %g V", called, info.name, info.rate_hz,
	     info.bits, info.full_scale_V, info.offset_V);
	note("%s: %d samples in %.3f s, spacing %.2f to %.2f us, %d not within 5 us, lost %llu, "
	     "%d left out, at most %.2f us off the beat, %lld ms of processor (emulated)",
	     called, n, (double)(samples[n - 1].t_ns - samples[0].t_ns) / 1e9,
	     least / 1e3, most / 1e3, outside,
	     (unsigned long long)incise_force_lost(force), left_out, far / 1e3,
	     (long long)cpu);
	check(info.rate_hz == HZ && info.bits == 12 &&
		      fabs(info.full_scale_V - 5) < 1e-9 &&
		      fabs(info.offset_V + 2.5) < 1e-9,
	      "%s: 10 kHz, 12 bits, 5 V from -2.5 V", called);
	check(clock, "%s: stamps are of CLOCK_MONOTONIC", called);
	check(incise_force_lost(force) >= missing,
	      "%s: what is a gap in seq is told as lost", called);
	if (virtual_time) {
		check(n == many && order && !incise_force_lost(force),
		      "%s: %d of %d samples in order, none lost", called, n, many);
		check(codes, "%s: each code is the one converted", called);
		check(info.clipped >= clipped && clipped == ends,
		      "%s: both ends of the range are told as clipped", called);
		check(!counted("overflows") && !counted("lost") && !counted("skipped"),
		      "%s: the simulator lost none either", called);
		check(outside <= (many + RARE - 1) / RARE && far < NEVER_NS &&
			      left_out <= (*trigger ? 0 : many / LEFT_OUT) &&
			      least > PERIOD_NS - NEVER_NS &&
			      most < (left_out ? 2 : 1) * PERIOD_NS + NEVER_NS,
		      "%s: spacing within 5 us of 100 us, but for %d", called, outside);
	}
	force->ops->close(force);
}

/*
 * The program is held for two seconds: the kernel's buffer has room for half a second. What
 * it had none for must be what is reported as lost, to the sample.
 */
static void overflow_is_counted(void)
{
	struct incise_force_info info;
	struct incise_force *force;
	struct incise_error err;
	uint64_t missing = 0;
	int64_t overflows;
	int more, rc;

	feed_ramp();
	force = open_force(INCISE_SIM_ADC, INCISE_SIM_TRIGGER, HZ, &err);
	if (!check(force, "it opens for an overflow %s", err.text))
		return;
	take(force, HZ, 5000, &rc);
	hold_ms(2000);
	more = take(force, 2 * HZ, 5000, &rc);
	overflows = counted("overflows") + counted("lost") + counted("skipped");
	incise_force_info(force, &info);
	for (int i = 1; i < more; i++)
		missing += samples[i].seq - samples[i - 1].seq - 1;
	note("held for 2 s: the simulator could not hand over %lld, lost says %llu in %llu "
	     "overflow",
	     (long long)overflows, (unsigned long long)incise_force_lost(force),
	     (unsigned long long)info.overflows);
	if (virtual_time) {
		check(overflows > HZ && incise_force_lost(force) == (uint64_t)overflows &&
			      missing == (uint64_t)overflows && info.overflows == 1,
		      "an overflow is counted to the sample");
		check((uint64_t)samples[more - 1].code ==
			      samples[more - 1].seq % (INCISE_SIM_ADC_MAX + 1),
		      "behind it seq is still the number of the conversion");
	} else {
		check(incise_force_lost(force) > 0, "an overflow is told");
	}
	force->ops->close(force);
}

/* Nobody reads: the ring has room for four seconds. */
static void reader_is_slow(void)
{
	struct incise_force_info info;
	struct incise_force *force;
	struct incise_error err;
	uint64_t expected = 0, missing = 0;
	int n, rc;

	if (!virtual_time)
		return;
	feed_ramp();
	force = open_force(INCISE_SIM_ADC, INCISE_SIM_TRIGGER, HZ, &err);
	if (!check(force, "it opens for a slow reader %s", err.text))
		return;
	nap(8000);
	n = take(force, 7 * HZ, 20, &rc);
	for (int i = 0; i < n; i++) {
		missing += samples[i].seq - expected;
		expected = samples[i].seq + 1;
	}
	incise_force_info(force, &info);
	note("not read for 8 s: %d samples came, %llu were dropped", n,
	     (unsigned long long)missing);
	check(n >= 4 * HZ && missing > HZ && incise_force_lost(force) == missing &&
		      info.overflows == 1 && !counted("overflows"),
	      "what nobody read in time is a gap, counted to the sample");
	force->ops->close(force);
}

static bool file_is(const char *path, const char *text)
{
	char is[80] = "";
	int fd = open(path, O_RDONLY | O_CLOEXEC);
	ssize_t n = read(fd, is, sizeof(is) - 1);

	close(fd);
	return n > 0 && !strncmp(is, text, strlen(text)) && is[strlen(text)] == '\n';
}

static const char *device_folder(void)
{
	static char path[80];

	for (int i = 0; i < 16; i++) {
		char name[100];

		snprintf(path, sizeof(path), "/sys/bus/iio/devices/iio:device%d", i);
		snprintf(name, sizeof(name), "%s/name", path);
		if (file_is(name, INCISE_SIM_ADC))
			return path;
	}
	return "/nonexistent";
}

static void refusals(void)
{
	static const struct {
		const char *device, *trigger;
		double rate_hz;
		int code;
		const char *says;
	} cases[] = {
		{"none", "", HZ, ENODEV, "no such IIO device \"none\"; there are: "},
		{INCISE_SIM_ADC, "none", HZ, ENODEV, "no such trigger \"none\""},
		{INCISE_SIM_ADC, INCISE_SIM_TRIGGER, 50000, EINVAL,
		 "does not support 50000 Hz"},
		{INCISE_SIM_ADC, "", 0, EINVAL, "correct force_setup"},
		{"", "", HZ, EINVAL, "expected iio:NAME"},
	};
	struct incise_force *force, *second;
	struct incise_error err;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		errno = 0;
		force = open_force(cases[i].device, cases[i].trigger, cases[i].rate_hz,
				   &err);
		check(!force && errno == cases[i].code && err.code == cases[i].code &&
			      strstr(err.text, cases[i].says),
		      "refused: %s", err.text);
	}
	force = open_force(INCISE_SIM_ADC, INCISE_SIM_TRIGGER, HZ, &err);
	second = open_force(INCISE_SIM_ADC, INCISE_SIM_TRIGGER, HZ, &err);
	check(force && !second && err.code == EBUSY, "a second one: %s", err.text);
	if (force)
		force->ops->close(force);
}

/* A converter that a killed program left running does not hinder the next. */
static void after_a_kill(void)
{
	struct incise_force *force;
	struct incise_error err;
	char path[100];
	pid_t child = fork();
	int rc, n;

	if (!child) {
		open_force(INCISE_SIM_ADC, INCISE_SIM_TRIGGER, HZ, &err);
		raise(SIGKILL);
	}
	waitpid(child, NULL, 0);
	snprintf(path, sizeof(path), "%s/buffer/enable", device_folder());
	note("after kill -9 the buffer is %s", file_is(path, "1") ? "on" : "off");
	force = open_force(INCISE_SIM_ADC, INCISE_SIM_TRIGGER, HZ, &err);
	n = force ? take(force, 100, 5000, &rc) : 0;
	check(n == 100, "it opens after a program that was killed %s", err.text);
	if (force)
		force->ops->close(force);
}

static void own_trigger_goes(void)
{
	char made[100], current[120];
	struct incise_force *force;
	struct incise_error err;
	pid_t child;

	snprintf(current, sizeof(current), "%s/trigger/current_trigger", device_folder());
	snprintf(made, sizeof(made), IIO_SOURCE_TRIGGERS "/incise-%d-0", getpid());
	force = open_force(INCISE_SIM_ADC, "", HZ, &err);
	check(force && !access(made, F_OK), "a trigger is made %s", err.text);
	if (force)
		force->ops->close(force);
	check(access(made, F_OK) && file_is(current, INCISE_SIM_TRIGGER),
	      "and goes, and the one before is back");
	child = fork();
	if (!child) {
		open_force(INCISE_SIM_ADC, "", HZ, &err);
		raise(SIGKILL);
	}
	waitpid(child, NULL, 0);
	snprintf(made, sizeof(made), IIO_SOURCE_TRIGGERS "/incise-%d-0", child);
	check(!access(made, F_OK), "a killed program leaves its trigger");
	force = open_force(INCISE_SIM_ADC, "", HZ, &err);
	check(force && access(made, F_OK), "the next one removes it %s", err.text);
	if (force)
		force->ops->close(force);
	simulator_write("adc/control", "reset");
}

static int found(void *context, const struct incise_scan_device *device)
{
	note("%s: %s", device->device, device->what);
	for (int i = 0; i < device->n; i++)
		note("  %s = %s", device->property[i].key, device->property[i].text);
	*(int *)context +=
		device->usable && !strcmp(device->device, "iio:" INCISE_SIM_ADC);
	return 0;
}

static void is_listed(void)
{
	struct incise_error err = {0};
	int n = 0;

	check(!incise_force_iio.scan("", found, &n, &err) && n == 1, "it is listed once");
}

/* The commands of the udev rules; then access as a member of the group. */
#define GROUP 31337
static void is_for_the_group(void)
{
	static const gid_t group = GROUP;
	struct incise_force *force;
	struct incise_error err;
	char command[1000];
	int status, rc;
	pid_t child;

	snprintf(
		command, sizeof(command),
		"for entry in %s /sys/bus/iio/devices/trigger*; do "
		"sed -n '/iio.*RUN/s/RUN+=/\\n/gp' udev/70-incise-sources.rules | "
		"sed -n 's/^\"\\(.*\\)\".*/\\1/p' | "
		"sed \"s| incise | %d |; s|/sys%%p|$(readlink -f $entry)|\" | sh -e || exit 1; "
		"done; chgrp %d /dev/iio:device0 && chmod 660 /dev/iio:device0",
		device_folder(), GROUP, GROUP);
	check(!system(command), "the rules of udev give it to the group");
	child = fork();
	if (!child) {
		if (setgroups(1, &group) || setgid(65534) || setuid(65534))
			_exit(2);
		force = open_force(INCISE_SIM_ADC, INCISE_SIM_TRIGGER, HZ, &err);
		if (!force)
			note("%s", err.text);
		_exit(!force || take(force, 100, 5000, &rc) != 100);
	}
	waitpid(child, &status, 0);
	check(WIFEXITED(status) && !WEXITSTATUS(status), "one of the group samples");
	child = fork();
	if (!child) {
		if (setgroups(0, NULL) || setgid(65534) || setuid(65534))
			_exit(2);
		force = open_force(INCISE_SIM_ADC, INCISE_SIM_TRIGGER, HZ, &err);
		note("%s", err.text);
		_exit(!force && errno == EACCES ? 0 : 1);
	}
	waitpid(child, &status, 0);
	check(WIFEXITED(status) && !WEXITSTATUS(status), "someone else may not");
}

static void is_unplugged(void)
{
	struct incise_force *force;
	struct incise_error err;
	int rc;

	force = open_force(INCISE_SIM_ADC, INCISE_SIM_TRIGGER, HZ, &err);
	if (!check(force, "it opens to be unplugged %s", err.text))
		return;
	take(force, 1000, 5000, &rc);
	check(!system("echo " INCISE_SIM_LABEL
		      " >/sys/bus/platform/drivers/" INCISE_SIM_LABEL "/unbind"),
	      "unbinding while it samples");
	while ((rc = incise_force_read(force, samples, MANY)) >= 0)
		nap(2);
	check(rc == -ENODEV, "its reader is told ENODEV after what was left");
	check(incise_force_read(force, samples, MANY) == -ENODEV, "and again");
	force->ops->close(force);
}

int main(int argc, char **argv)
{
	const char *profile = getenv("INCISE_VM_PROFILE");
	const char *kernel = getenv("INCISE_VM_KERNEL");
	bool hrtimer = argc > 2;

	virtual_time = profile && !strcmp(profile, "deterministic");
	if (argc < 2 || !check(!module_load(argv[1], ""), "the simulator loads"))
		return 1;
	/* In virtual time a page that is fetched is a jump of the clock. */
	memset(samples, 1, sizeof(samples));
	mlockall(MCL_CURRENT | MCL_FUTURE);
	is_listed();
	/* The long one on one kernel only: it takes as long as emulated. */
	all_come(INCISE_SIM_TRIGGER, "own trigger",
		 !virtual_time			     ? 2
		 : kernel && !strcmp(kernel, "main") ? 10
						     : SECONDS);
	if (hrtimer) {
		all_come("", "hrtimer trigger", virtual_time ? 10 : 2);
		own_trigger_goes();
	}
	overflow_is_counted();
	reader_is_slow();
	refusals();
	after_a_kill();
	is_for_the_group();
	is_unplugged();
	check(!module_unload("incise_sim"), "the simulator goes");
	return tap_failures != 0;
}
