// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A plan that is refused, and one whose force is taken away: by its owner, by poses that are none,
 * by a fault of one of its motors, by unbind and sleep. Each says why.
 *
 *   stepper_plan_stops
 *
 * Times are asserted in virtual time only.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "../../../lib/fixed/layout.h"
#include "../plan_feed.h"
#include "../tap.h"

#define MOTORS 2
#define ALL 3U
#define TICK_NS 1000000
#define LONG 60000000000
#define PAGE 4096

static struct bench bench, watch;
static struct plan_feed *feed;
static pid_t feeder = -1, watcher = -1;
static struct incise_fixed_plan_header *head;
static uint32_t size;
static bool virtual_time;

/* Longer than any fade, and in real time than any pause of the machine. */
static uint64_t deadman_ns(void)
{
	return virtual_time ? 300000000 : 5000000000;
}

static uint32_t crc_of(const struct incise_fixed_plan_header *file)
{
	return incise_fx_crc((const uint8_t *)file + INCISE_FIXED_PLAN_CRC_FROM,
			     size - INCISE_FIXED_PLAN_CRC_FROM);
}

static bool motors_rest(void)
{
	int64_t end_ns = bench_now_ns() + LONG;
	const uint32_t rest =
		1U << INCISE_STEPPER_STATE_FAULT | 1U << INCISE_STEPPER_STATE_DISABLED;

	for (int m = 0; m < MOTORS; m++)
		while (!(rest >> bench_look(&watch, m).state & 1)) {
			if (bench_now_ns() > end_ns)
				return false;
			bench_nap(1000000);
		}
	return true;
}

static int configure(void)
{
	int ret = 0;

	for (int m = 0; m < MOTORS && !ret; m++) {
		struct incise_stepper_config config =
			plan_config(&bench, m, TICK_NS, deadman_ns());

		ret = bench_configure(&bench, &config, 750);
	}
	return ret;
}

/* The plan is there, its motors have power, and its force is felt. */
static bool feel(const char *what)
{
	int ret;

	plan_kill(&feeder);
	bench_command(&bench, INCISE_STEPPER_DISABLE, ALL);
	motors_rest();
	bench_command(&bench, INCISE_STEPPER_CLEAR, ALL);
	plan_unload(&bench, ALL);
	ret = configure();
	ret = ret ? ret : plan_load(&bench, head, size, ALL);
	ret = ret ? ret : bench_command(&bench, INCISE_STEPPER_ENABLE, ALL);
	feed->depth_um = -2000;
	feed->tool = INCISE_TOOL_BLADE;
	plan_pose(&bench, 1, &(struct incise_fixed_pose){.t_ns = 0});
	feeder = plan_feeder(&bench, feed);
	if (!check(!ret && plan_until(&bench, INCISE_STEPPER_PLAN_FELT, LONG),
		   "%s: a force is felt (%s)", what, strerror(-ret)))
		return false;
	feed->depth_um = 2000;
	bench_nap(200000000);
	return plan_watch_reset(feed);
}

/* After it: the force went no faster than it may. */
static void faded(const char *what, uint32_t reason)
{
	if (virtual_time)
		check(feed->steepest <= head->numbers.slew && feed->force_max > 0,
		      "%s: the force fades at its slew, %.3f N a tick", what,
		      feed->steepest / 65536.0);
	check(feed->reasons & reason, "%s: the status has the reason, %#x", what,
	      feed->reasons);
}

/* Of a module built with INCISE_PLAN=n there is nothing else to be seen. */
static bool takes_plans(void)
{
	bool takes = bench.info.capabilities & INCISE_STEPPER_CAP_PLAN;
	int ret;

	configure();
	ret = plan_load(&bench, head, size, ALL);
	check(ret == (takes ? 0 : -EOPNOTSUPP),
	      "LOAD_PLAN is as its capability says (%s)", strerror(-ret));
	plan_unload(&bench, ALL);
	return takes;
}

static void refused_files(void)
{
	struct incise_fixed_plan_header wrong = *head;
	struct incise_stepper_config config;

	check(plan_load(&bench, head, size, 1) == -EINVAL,
	      "a plan of two axes for one motor: EINVAL");
	check(plan_load(&bench, head, size, 5) == -EINVAL,
	      "for a motor that is none: EINVAL");
	check(plan_load(&bench, head, size - 8, ALL) == -EINVAL, "cut short: EINVAL");
	check(plan_load(&bench, head, INCISE_FIXED_PLAN_SIZE_MAX + 1, ALL) == -EFBIG,
	      "too large: EFBIG");
	check(plan_load(&bench, (void *)8, size, ALL) == -EFAULT, "from nowhere: EFAULT");
	wrong.version = INCISE_FIXED_PLAN_VERSION_TEXTURE + 1;
	check(plan_load(&bench, &wrong, sizeof(wrong), ALL) == -EOPNOTSUPP,
	      "of another version: EOPNOTSUPP");
	wrong = *head;
	wrong.numbers.slew = 0;
	wrong.crc = crc_of(&wrong);
	check(plan_load(&bench, &wrong, sizeof(wrong), ALL) == -EINVAL,
	      "without a slew, its CRC right: EINVAL");
	check(plan_load(&watch, head, size, ALL) == -EPERM, "by one who watches: EPERM");
	config = plan_config(&bench, 1, TICK_NS, 1000000);
	bench_configure(&bench, &config, 750);
	check(plan_load(&bench, head, size, ALL) == -ERANGE,
	      "with a deadman shorter than a fade: ERANGE");
	config = plan_config(&bench, 1, 2 * TICK_NS, deadman_ns());
	bench_configure(&bench, &config, 750);
	check(plan_load(&bench, head, size, ALL) == -ERANGE,
	      "with a motor slower than the plan: ERANGE");
	check(plan_look(&bench).state == INCISE_STEPPER_PLAN_EMPTY, "there is no plan");
}

static void refused_flags(void)
{
	struct incise_stepper_plan plan = {
		.motors = ALL,
		.flags = 1,
		.data = (uintptr_t)head,
		.size = size,
	};

	configure();
	check(ioctl(bench.fd, INCISE_STEPPER_LOAD_PLAN, &plan) && errno == EINVAL,
	      "a flag that is none: EINVAL");
}

static void busy(void)
{
	struct incise_stepper_origin origin = {.motor = 0, .position = 750};
	struct incise_stepper_config config =
		plan_config(&bench, 0, TICK_NS, deadman_ns());

	if (!feel("busy"))
		return;
	check(plan_load(&bench, head, size, ALL) == -EBUSY,
	      "LOAD_PLAN while it is felt: EBUSY");
	check(plan_unload(&bench, ALL) == -EBUSY, "and taking it away: EBUSY");
	check(ioctl(bench.fd, INCISE_STEPPER_SET_POSITION, &origin) && errno == EBUSY,
	      "SET_POSITION: EBUSY");
	bench_command(&bench, INCISE_STEPPER_DISABLE, ALL);
	motors_rest();
	check(!bench_look(&bench, 0).faults && !bench_look(&bench, 1).faults,
	      "DISABLE of all is no fault");
	check(plan_look(&bench).state == INCISE_STEPPER_PLAN_LOADED,
	      "the plan is loaded");
	check(ioctl(bench.fd, INCISE_STEPPER_SET_CONFIG, &config) && errno == EBUSY,
	      "SET_CONFIG of its motor: EBUSY");
	check(!plan_unload(&bench, ALL) &&
		      !ioctl(bench.fd, INCISE_STEPPER_SET_CONFIG, &config),
	      "it is taken away, and SET_CONFIG is taken");
	check(plan_look(&bench).state == INCISE_STEPPER_PLAN_EMPTY &&
		      !plan_look(&bench).motors,
	      "its status is empty");
}

/* A pose of the feeder's kind, at another time. */
static struct incise_fixed_pose pose_at(int64_t t_ns)
{
	return (struct incise_fixed_pose){
		.t_ns = t_ns,
		.position = {0, 0, 48 << 16},
		.quaternion = {1 << 30},
		.tool = INCISE_TOOL_BLADE,
	};
}

static void odd_poses(void)
{
	struct incise_stepper_plan_status before, after;
	struct incise_fixed_pose pose;

	if (!feel("poses"))
		return;
	plan_kill(&feeder);
	pose = pose_at(bench_now_ns() + 3600000000000);
	before = plan_look(&bench);
	plan_pose(&bench, 0, &pose);
	bench_nap(5000000);
	pose = pose_at(bench_now_ns());
	plan_pose(&bench, 0, &pose);
	bench_nap(5000000);
	after = plan_look(&bench);
	check(after.poses == before.poses + 2 && after.refused == before.refused,
	      "a pose from the future counts as of now, and the next is taken");
	pose = pose_at(bench_now_ns() - 100000000);
	plan_pose(&bench, 0, &pose);
	bench_nap(5000000);
	pose = pose_at(bench_now_ns());
	pose.position[1] = 12000 << 16;
	plan_pose(&bench, 0, &pose);
	bench_nap(5000000);
	after = plan_look(&bench);
	check(after.refused == before.refused + 2 &&
		      after.reasons & INCISE_STEPPER_PLAN_REFUSED &&
		      !bench_look(&bench, 0).faults,
	      "old and far ones are refused, and no fault");
	/* They are no sign of life. */
	for (int64_t end_ns = bench_now_ns() + LONG;
	     !bench_look(&bench, 0).faults && bench_now_ns() < end_ns;) {
		pose = pose_at(1);
		plan_pose(&bench, 0, &pose);
		bench_nap(1000000);
	}
	/* Of the two motors one is the first. */
	check(bench_look(&bench, 0).faults & INCISE_STEPPER_FAULT_DEADMAN,
	      "nor a sign of life: DEADMAN (%#x)", bench_look(&bench, 0).faults);
	motors_rest();
	check(bench_look(&bench, 1).faults &
		      (INCISE_STEPPER_FAULT_PLAN | INCISE_STEPPER_FAULT_DEADMAN),
	      "the other motor stops too (%#x)", bench_look(&bench, 1).faults);
	check(plan_look(&bench).reasons & INCISE_STEPPER_PLAN_STOPPED,
	      "the status says so");
	faded("no poses", INCISE_STEPPER_PLAN_SILENT);
}

static void asked(void)
{
	if (!feel("asked"))
		return;
	feed->tool = INCISE_TOOL_BLADE | INCISE_STEPPER_POSE_FADE;
	bench_nap(200000000);
	check(plan_look(&bench).state == INCISE_STEPPER_PLAN_FADE &&
		      !plan_look(&bench).command[2],
	      "a pose that asks for it lets the force go");
	faded("asked", INCISE_STEPPER_PLAN_ASKED);
	feed->tool = INCISE_TOOL_BLADE;
	check(plan_until(&bench, INCISE_STEPPER_PLAN_FELT, LONG),
	      "and without it comes back");
}

/* A slot of mode POSE that is wrong in one place. */
static void garbage(const char *what, uint32_t tool, uint64_t reserved, int64_t target)
{
	volatile struct incise_stepper_setpoint *slot = &bench.setpoint[0];

	if (!feel(what))
		return;
	plan_kill(&feeder);
	slot->seq++;
	__atomic_thread_fence(__ATOMIC_SEQ_CST);
	slot->mode = INCISE_STEPPER_MODE_POSE;
	slot->t_ns = bench_now_ns();
	slot->target = target;
	slot->pose.tool = tool;
	slot->pose.reserved = reserved;
	__atomic_thread_fence(__ATOMIC_SEQ_CST);
	slot->seq++;
	motors_rest();
	check(bench_look(&bench, 0).faults & INCISE_STEPPER_FAULT_SETPOINT,
	      "%s: SETPOINT (%#x)", what, bench_look(&bench, 0).faults);
	check(bench_look(&bench, 1).faults & INCISE_STEPPER_FAULT_PLAN,
	      "%s: the other motor: PLAN (%#x)", what, bench_look(&bench, 1).faults);
}

static void no_plan(void)
{
	struct incise_fixed_pose pose = pose_at(bench_now_ns());

	bench_command(&bench, INCISE_STEPPER_CLEAR, ALL);
	plan_unload(&bench, ALL);
	check(!bench_command(&bench, INCISE_STEPPER_ENABLE, 1), "no plan: power");
	plan_pose(&bench, 0, &pose);
	motors_rest();
	check(bench_look(&bench, 0).faults == INCISE_STEPPER_FAULT_SETPOINT,
	      "no plan: a pose is the fault SETPOINT (%#x)",
	      bench_look(&bench, 0).faults);
	bench_command(&bench, INCISE_STEPPER_CLEAR, ALL);
}

static void one_stops(void)
{
	if (!feel("limit"))
		return;
	/* Its power stage reports a fault. */
	simulator_write("inputs", "%u 1", bench_line(1, BENCH_FAULT));
	motors_rest();
	check(bench_look(&bench, 1).faults & INCISE_STEPPER_FAULT_ALARM &&
		      bench_look(&bench, 0).faults == INCISE_STEPPER_FAULT_PLAN,
	      "an alarm of one motor: PLAN for the other (%#x, %#x)",
	      bench_look(&bench, 1).faults, bench_look(&bench, 0).faults);
	check(plan_look(&bench).reasons & INCISE_STEPPER_PLAN_STOPPED &&
		      plan_look(&bench).state == INCISE_STEPPER_PLAN_LOADED &&
		      !plan_look(&bench).command[2],
	      "the plan has stopped, without a force");
	simulator_write("inputs", "%u 0", bench_line(1, BENCH_FAULT));
	check(!bench_command(&bench, INCISE_STEPPER_CLEAR, ALL) &&
		      !bench_command(&bench, INCISE_STEPPER_ENABLE, ALL),
	      "they get power again");
	plan_pose(&bench, 1, &(struct incise_fixed_pose){.t_ns = 0});
	bench_nap(100000000);
	check(plan_look(&bench).state == INCISE_STEPPER_PLAN_WAIT &&
		      !plan_look(&bench).command[2],
	      "in the tissue no force comes");
	feed->depth_um = -2000;
	check(plan_until(&bench, INCISE_STEPPER_PLAN_FELT, LONG), "out of it, it does");
	bench_command(&bench, INCISE_STEPPER_DISABLE, 2);
	motors_rest();
	check(bench_look(&bench, 0).faults == INCISE_STEPPER_FAULT_PLAN &&
		      !bench_look(&bench, 1).faults,
	      "DISABLE of one: PLAN for the other");
}

static void sleeps(void)
{
	if (!feel("sleep"))
		return;
	check(!simulator_write("sleep", "suspend=%s", bench.dev_name),
	      "the machine sleeps");
	check(bench_look(&bench, 0).faults == INCISE_STEPPER_FAULT_SUSPEND &&
		      bench_look(&bench, 1).faults == INCISE_STEPPER_FAULT_SUSPEND,
	      "SUSPEND for both (%#x, %#x)", bench_look(&bench, 0).faults,
	      bench_look(&bench, 1).faults);
	faded("sleep", INCISE_STEPPER_PLAN_AWAY);
	simulator_write("sleep", "resume=%s", bench.dev_name);
	bench_nap(20000000);
	check(plan_look(&bench).state == INCISE_STEPPER_PLAN_LOADED,
	      "after it nothing moves by itself");
}

static void owner_leaves(void)
{
	struct bench next = bench;
	int ret;

	if (!feel("owner"))
		return;
	plan_kill(&feeder);
	bench_close(&bench);
	ret = bench_open(&next);
	check(!ret, "another owner comes while the force fades (%s)", strerror(-ret));
	if (plan_look(&watch).state == INCISE_STEPPER_PLAN_FADE)
		check(bench_command(&next, INCISE_STEPPER_ENABLE, ALL) == -EBUSY,
		      "ENABLE then: EBUSY");
	motors_rest();
	bench_nap(20000000);
	check(bench_look(&watch, 0).faults == INCISE_STEPPER_FAULT_OWNER &&
		      bench_look(&watch, 1).faults == INCISE_STEPPER_FAULT_OWNER,
	      "OWNER for both (%#x, %#x)", bench_look(&watch, 0).faults,
	      bench_look(&watch, 1).faults);
	faded("owner", INCISE_STEPPER_PLAN_LEFT);
	check(plan_look(&watch).state == INCISE_STEPPER_PLAN_EMPTY,
	      "the plan went with its owner");
	bench = next;
}

static bool watch_opens(void)
{
	watch = bench;
	watch.fd = open(bench.cdev, O_RDONLY | O_CLOEXEC);
	watch.status = mmap(NULL, PAGE, PROT_READ, MAP_SHARED, watch.fd,
			    INCISE_STEPPER_PAGE_STATUS * PAGE);
	return watch.fd >= 0 && watch.status != MAP_FAILED;
}

static void goes(void)
{
	if (!feel("unbind"))
		return;
	check(module_unload("incise_stepper") < 0,
	      "the module does not go while it is in use");
	check(!bench_unbind(&bench), "unbound while it is felt");
	check(bench_look(&watch, 0).faults == INCISE_STEPPER_FAULT_GONE &&
		      bench_look(&watch, 1).faults == INCISE_STEPPER_FAULT_GONE,
	      "GONE for both (%#x, %#x)", bench_look(&watch, 0).faults,
	      bench_look(&watch, 1).faults);
	bench_nap(5000000);
	faded("unbind", INCISE_STEPPER_PLAN_AWAY);
	check(plan_load(&bench, head, size, ALL) == -ENODEV, "LOAD_PLAN then: ENODEV");
}

static void all(void)
{
	refused_files();
	refused_flags();
	busy();
	odd_poses();
	asked();
	garbage("an unknown bit of tool", 1U << 10, 0, 0);
	garbage("a tool that is none", INCISE_TOOL_TUBE + 1, 0, 0);
	garbage("reserved", INCISE_TOOL_BLADE, 1, 0);
	garbage("a target", INCISE_TOOL_BLADE, 0, 7);
	no_plan();
	one_stops();
	sleeps();
	owner_leaves();
	goes();
}

int main(void)
{
	const struct plan_recipe recipe = {"stops", INCISE_FIXED_PLANE, MOTORS, TICK_NS,
					   .plain = true};
	const char *profile = getenv("INCISE_VM_PROFILE");
	int ret;

	virtual_time = profile && !strcmp(profile, "deterministic");
	head = plan_make(&recipe, &size);
	feed = plan_feed_new();
	ret = bench_bind(&bench, MOTORS);
	if (!check(head && feed && !ret && watch_opens(), "two motors are bound (%s)",
		   strerror(-ret)))
		return 1;
	/* Before there is an owner, whose file it must not hold. */
	watcher = plan_watcher(&watch, feed, MOTORS);
	ret = bench_open(&bench);
	check(!ret, "its owner comes (%s)", strerror(-ret));
	if (takes_plans())
		all();
	else
		check(!bench_unbind(&bench), "unbound");
	plan_kill(&feeder);
	plan_kill(&watcher);
	bench_close(&bench);
	munmap((void *)watch.status, PAGE);
	close(watch.fd);
	return tap_failures != 0;
}
