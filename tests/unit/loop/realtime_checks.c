// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/loop/realtime_checks.c with given answers and files in a folder; it asks this machine nothing.
 */
#include "../unit.h"
#include "../../../lib/loop/realtime.h"
#include "root_folder.h"

#define CPUS "/sys/devices/system/cpu/"
#define CLOCKSOURCE "/sys/devices/system/clocksource/clocksource0/current_clocksource"
#define PRLIMIT "sudo prlimit --pid $$ --rtprio=90 --memlock=unlimited"
#define NICE "Name:\tx\nCapEff:\t0000000000800000\n"
#define NOT_NICE "Name:\tx\nCapEff:\t000001ffff7fffff\n"

struct file {
	const char *path, *text;
};

struct row {
	const char *check;
	struct incise_realtime_setup setup;
	struct realtime_answers answers;
	struct file files[3];
	bool ok;
	const char *found, *fix; /* parts of them; NULL: there is none */
};

#define FIFO .setup = {.priority = 80, .cpu = -1, .period_ns = 1000000}
#define ON_CPU(n) .setup = {.priority = 80, .cpu = (n), .period_ns = 1000000}
#define DEADLINE .setup = {INCISE_REALTIME_DEADLINE, .cpu = -1, .period_ns = 1000000}
#define FILES(...) .files = {__VA_ARGS__}

static const struct row rows[] = {
	{"scheduling", FIFO, .ok = true, .found = "SCHED_FIFO at priority 80"},
	{"scheduling",
	 FIFO,
	 {.policy_error = EPERM, .rtprio = 0},
	 .fix = PRLIMIT,
	 .found = "RLIMIT_RTPRIO is 0"},
	{"scheduling",
	 FIFO,
	 {.policy_error = EPERM, .rtprio = 79},
	 .fix = PRLIMIT,
	 .found = "RLIMIT_RTPRIO is 79"},
	/* The limit is wide enough. */
	{"scheduling",
	 FIFO,
	 {.policy_error = EPERM, .rtprio = 80},
	 .found = "control group",
	 .fix = "tee /sys/fs/cgroup/cpu/cgroup.procs"},
	{"scheduling",
	 FIFO,
	 {.policy_error = EPERM, .rtprio = RLIM_INFINITY},
	 FILES({"/sys/fs/cgroup/cgroup.procs", "1\n"}),
	 .found = "RestrictRealtime=",
	 .fix = "tee /sys/fs/cgroup/cgroup.procs"},
	{"scheduling", FIFO, {.policy_error = ENOSYS}, .found = "not implemented"},
	{"scheduling", DEADLINE, .ok = true, .found = "half of each period of 1000 us"},
	{"scheduling",
	 DEADLINE,
	 {.policy_error = EPERM},
	 FILES({"/proc/self/status", NOT_NICE}),
	 .found = "CAP_SYS_NICE",
	 .fix = "--ambient-caps=+sys_nice,+ipc_lock $SHELL"},
	{"scheduling",
	 DEADLINE,
	 {.policy_error = EPERM},
	 .found = "CAP_SYS_NICE",
	 .fix = "setpriv"},
	{"scheduling",
	 DEADLINE,
	 {.policy_error = EPERM},
	 FILES({"/proc/self/status", NICE}, {CPUS "online", "0-3\n"}),
	 .found = "not run on all CPUs",
	 .fix = "taskset -pc 0-3 $$"},
	/* A file does not write commands. */
	{"scheduling",
	 DEADLINE,
	 {.policy_error = EPERM},
	 FILES({"/proc/self/status", NICE}, {CPUS "online", "0;reboot\n"}),
	 .found = "not run on all CPUs"},
	{"scheduling",
	 DEADLINE,
	 {.policy_error = EBUSY},
	 .found = "reserved",
	 .fix = "ps -eo"},
	{"scheduling", DEADLINE, {.policy_error = EINVAL}, .found = "Invalid"},

	{"memory", FIFO, {.lock_bytes = 5 << 20}, .ok = true, .found = "6 MiB"},
	{"memory",
	 FIFO,
	 {.lock_error = ENOMEM, .memlock = 8 << 20, .lock_bytes = 1 << 25},
	 .found = "33 MiB of addresses cannot be locked: RLIMIT_MEMLOCK is 8192 KiB",
	 .fix = PRLIMIT},
	{"memory",
	 FIFO,
	 {.lock_error = EPERM, .memlock = 0},
	 .found = "is 0 KiB",
	 .fix = PRLIMIT},
	{"memory",
	 FIFO,
	 {.lock_error = ENOMEM, .memlock = RLIM_INFINITY},
	 .found = "Cannot allocate",
	 .fix = PRLIMIT},
	/* One right implies the other. */
	{"memory",
	 DEADLINE,
	 {.lock_error = ENOMEM, .policy_error = EPERM},
	 .found = "RLIMIT_MEMLOCK",
	 .fix = "setpriv"},

	{"cpu", ON_CPU(1), .ok = true, .found = "CPU 1"},
	{"cpu",
	 ON_CPU(7),
	 {.cpu_error = EINVAL},
	 FILES({CPUS "online", "0-3\n"}),
	 .found = "there are 0-3"},
	{"cpu",
	 ON_CPU(2),
	 {.cpu_error = EINVAL},
	 FILES({CPUS "online", "0-3\n"}),
	 .found = "cpuset"},
	{"cpu", ON_CPU(2), {.cpu_error = EINVAL}, .found = "cpuset"},
	{"cpu", ON_CPU(2), {.cpu_error = EPERM}, .found = "not permitted"},

	{"kernel", FIFO, FILES({"/sys/kernel/realtime", "1\n"}), .ok = true,
	 .found = "PREEMPT_RT"},
	{"kernel", FIFO, FILES({"/sys/kernel/realtime", "0\n"}),
	 .found = "not PREEMPT_RT", .fix = ""},
	{"kernel", FIFO, FILES({"/sys/kernel/realtime", "11"}), .found = "not PREEMPT_RT",
	 .fix = ""},
	{"kernel", FIFO, .found = "not PREEMPT_RT", .fix = ""},

#define RUNTIME "/proc/sys/kernel/sched_rt_runtime_us"
#define PERIOD "/proc/sys/kernel/sched_rt_period_us"
	{"throttling", FIFO, .ok = true, .found = "has none"},
	{"throttling", FIFO, FILES({RUNTIME, "950000\n"}, {PERIOD, "1000000\n"}),
	 .ok = true, .found = "95 % of a CPU"},
	{"throttling", FIFO, FILES({RUNTIME, "-1\n"}), .ok = true, .found = "off"},
	{"throttling", FIFO, FILES({RUNTIME, "500000\n"}), .found = "50 %",
	 .fix = "sched_rt_runtime_us=950000"},
	{"throttling", FIFO, FILES({RUNTIME, "950000\n"}, {PERIOD, "10000000\n"}),
	 .found = "10 %", .fix = "sched_rt_period_us=1000000"},
	{"throttling", FIFO, FILES({RUNTIME, "0\n"}), .found = "0 %", .fix = "sysctl"},
	{"throttling", FIFO, FILES({RUNTIME, "lots\n"}), .found = "0 %", .fix = "sysctl"},
	{"throttling", FIFO, FILES({RUNTIME, "-9223372036854775808"}, {PERIOD, "-1"}),
	 .found = "0 %", .fix = "sysctl"},
	{"throttling", FIFO, FILES({RUNTIME, "950000"}, {PERIOD, "0"}), .ok = true,
	 .found = "95 %"},

#define GOVERNOR(n) CPUS "cpu" #n "/cpufreq/scaling_governor"
	{"governor", FIFO, .ok = true, .found = "does not change"},
	{"governor", FIFO,
	 FILES({CPUS "online", "0-1"}, {GOVERNOR(0), "performance\n"},
	       {GOVERNOR(1), "performance\n"}),
	 .ok = true, .found = "performance"},
	{"governor", FIFO,
	 FILES({CPUS "online", "0-1"}, {GOVERNOR(0), "performance\n"},
	       {GOVERNOR(1), "schedutil\n"}),
	 .found = "schedutil, of CPU 1 and 0 others", .fix = "echo performance"},
	/* Only the loop's CPU matters. */
	{"governor", ON_CPU(0),
	 FILES({CPUS "online", "0-1"}, {GOVERNOR(0), "performance\n"},
	       {GOVERNOR(1), "powersave\n"}),
	 .ok = true, .found = "performance"},
	{"governor", ON_CPU(1), FILES({GOVERNOR(1), "powersave\n"}),
	 .found = "powersave, of CPU 1", .fix = "echo performance"},
	{"governor", FIFO, FILES({CPUS "online", "\xff\xfe"}, {GOVERNOR(0), "powersave"}),
	 .ok = true, .found = "does not change"},
	{"governor", ON_CPU(0), FILES({GOVERNOR(0), "\x1b[31mred"}), .found = "?[31mred",
	 .fix = "echo performance"},

#define IDLE CPUS "cpuidle/current_driver"
	{"idle", FIFO, .ok = true, .found = "no deep idle states"},
	{"idle",
	 FIFO,
	 {.idle_error = EACCES},
	 FILES({IDLE, "none\n"}),
	 .ok = true,
	 .found = "no deep idle states"},
	{"idle", FIFO, FILES({IDLE, "intel_idle\n"}), .ok = true, .found = "held at 0"},
	{"idle",
	 FIFO,
	 {.idle_error = EACCES},
	 FILES({IDLE, "intel_idle\n"}),
	 .found = "Permission denied",
	 .fix = "sudo chown $USER /dev/cpu_dma_latency"},
	{"idle",
	 FIFO,
	 {.idle_error = ENOENT},
	 FILES({IDLE, "acpi_idle\n"}),
	 .found = "No such file"},

	{"clock",
	 FIFO,
	 {.clock_resolution_ns = 1},
	 FILES({CLOCKSOURCE, "tsc\n"}),
	 .ok = true,
	 .found = "tsc"},
	{"clock", FIFO, {.clock_resolution_ns = 1}, .ok = true, .found = "unknown"},
	{"clock",
	 FIFO,
	 {.clock_resolution_ns = 1},
	 FILES({CLOCKSOURCE, "hpet\n"}),
	 .found = "hpet: reading it needs a system call",
	 .fix = "available_clocksource"},
	{"clock",
	 FIFO,
	 {.clock_resolution_ns = 4000000},
	 FILES({CLOCKSOURCE, "tsc\n"}),
	 .found = "of only 4 ms"},
	{"clock",
	 FIFO,
	 {.clock_resolution_ns = INT64_MAX},
	 .found = "timers have a resolution of only"},

	{"isolated", ON_CPU(3), FILES({CPUS "isolated", "2-3\n"}), .ok = true,
	 .found = "CPU 3 is isolated"},
	{"isolated", ON_CPU(1), FILES({CPUS "isolated", "2-3\n"}),
	 .found = "not isolated", .fix = "isolcpus=managed_irq,domain,1 nohz_full=1"},
	{"isolated", ON_CPU(1), FILES({CPUS "isolated", "\n"}), .found = "not isolated",
	 .fix = "update-grub"},
	{"isolated", ON_CPU(1023), .found = "not isolated", .fix = "nohz_full=1023"},
};

static const struct incise_realtime_check *named(
	const struct incise_realtime_check *checks, int n, const char *name)
{
	for (int i = 0; i < n; i++)
		if (!strcmp(checks[i].name, name))
			return &checks[i];
	return NULL;
}

/* One line with whole commands. */
static void assert_words(const struct incise_realtime_check *check)
{
	assert_true(*check->found && !strchr(check->found, '\n'));
	assert_true(strlen(check->found) < sizeof(check->found) - 1);
	assert_true(strlen(check->fix) < sizeof(check->fix) - 1);
	assert_true(strlen(check->keep) < sizeof(check->keep) - 1);
	if (check->ok)
		assert_true(!*check->fix && !*check->keep);
	/* A permanent command comes only with an immediate one. */
	if (!*check->fix)
		assert_true(!*check->keep);
}

TEST(test_table)
{
	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		const struct row *row = &rows[i];
		const struct incise_realtime_check *check;
		struct incise_realtime_check checks[INCISE_REALTIME_CHECKS];
		struct root_folder root;
		int n;

		root_folder_make(&root);
		for (int f = 0; f < 3 && row->files[f].path; f++)
			root_folder_say(&root, row->files[f].path, row->files[f].text);
		n = realtime_judge(&row->setup, &row->answers, root.path, checks,
				   INCISE_REALTIME_CHECKS);
		root_folder_remove(&root);
		assert_int_equal(n, row->setup.cpu < 0 ? 7 : 9);
		for (int k = 0; k < n; k++)
			assert_words(&checks[k]);
		check = named(checks, n, row->check);
		assert_non_null(check);
		if (check->ok != row->ok || !strstr(check->found, row->found) ||
		    (row->fix ? !strstr(check->fix, row->fix) : !!*check->fix))
			fail_msg("row %zu, %s: %s: %s; fix: %s", i, check->name,
				 check->ok ? "ok" : "not ok", check->found, check->fix);
	}
}

/* Required checks come first; a smaller array is allowed. */
TEST(test_order_and_capacity)
{
	static const char *const order[] = {"scheduling", "memory",	"cpu",
					    "kernel",	  "throttling", "governor",
					    "idle",	  "clock",	"isolated"};
	const struct incise_realtime_setup setup = {
		.priority = 80, .cpu = 0, .period_ns = 1000000};
	const struct realtime_answers answers = {0};
	struct incise_realtime_check checks[INCISE_REALTIME_CHECKS];

	for (int capacity = 0; capacity <= INCISE_REALTIME_CHECKS; capacity++) {
		memset(checks, 0x55, sizeof(checks));
		assert_int_equal(realtime_judge(&setup, &answers, "/nowhere", checks,
						capacity),
				 9);
		for (int i = 0; i < capacity; i++) {
			assert_string_equal(checks[i].name, order[i]);
			assert_int_equal(checks[i].needed, i < 3);
		}
		if (capacity < INCISE_REALTIME_CHECKS)
			assert_int_equal(((char *)&checks[capacity])[0], 0x55);
	}
}

TEST(test_denied)
{
	static const struct {
		const char *name;
		struct incise_realtime_setup setup;
		struct realtime_answers answers;
		int error;
		const char *with[3], *without;
	} denials[] = {
		{"nothing", FIFO, {0}, 0, {NULL}, NULL},
		{"both",
		 FIFO,
		 {.policy_error = EPERM, .lock_error = ENOMEM},
		 EPERM,
		 {"RLIMIT_RTPRIO is 0; ",
		  "RLIMIT_MEMLOCK is 0 KiB; run `" PRLIMIT "` and ",
		  "limits.d/incise.conf # then log in again`"},
		 PRLIMIT "; "},
		{"memory alone",
		 FIFO,
		 {.lock_error = ENOMEM},
		 EPERM,
		 {"1 MiB", PRLIMIT, "limits.d"},
		 "SCHED_FIFO"},
		{"CPU alone",
		 ON_CPU(900),
		 {.cpu_error = EINVAL},
		 EINVAL,
		 {"CPU 900", NULL, NULL},
		 "run `"},
		/* The permanent command no longer fits: all of it is left out. */
		{"a capability",
		 DEADLINE,
		 {.policy_error = EPERM, .lock_error = ENOMEM},
		 EPERM,
		 {"CAP_SYS_NICE", "$SHELL` and start again", NULL},
		 PRLIMIT},
		{"promised",
		 DEADLINE,
		 {.policy_error = EBUSY},
		 EBUSY,
		 {"reserved", NULL, NULL},
		 PRLIMIT},
	};

	for (size_t i = 0; i < sizeof(denials) / sizeof(*denials); i++) {
		struct incise_realtime_check checks[INCISE_REALTIME_CHECKS];
		struct incise_error err = {0};
		int n = realtime_judge(&denials[i].setup, &denials[i].answers, "/nowhere",
				       checks, INCISE_REALTIME_CHECKS);

		assert_int_equal(realtime_denied(&denials[i].answers, checks, n, &err),
				 -denials[i].error);
		assert_int_equal(err.code, denials[i].error);
		for (int k = 0; k < 3 && denials[i].with[k]; k++)
			assert_says(err.text, denials[i].with[k]);
		if (denials[i].without && strstr(err.text, denials[i].without))
			fail_msg("%s: %s", denials[i].name, err.text);
		/* Commands are whole: quotes come in pairs. */
		for (char *c = strchr(err.text, '`'); c; c = strchr(c + 1, '`')) {
			c = strchr(c + 1, '`');
			assert_non_null(c);
		}
		assert_int_equal(realtime_denied(&denials[i].answers, checks, n, NULL),
				 -denials[i].error);
	}
}
