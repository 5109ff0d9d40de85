// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/loop/realtime.c on this machine, in children, since it changes the whole process: with all
 * rights where there are any, and without. Counts of a thread: from given files, and those of a
 * real thread against getrusage(2).
 *
 *     test ── fork ──▶ child: rights away? ──▶ prepare ──▶ new ──▶ threads ──▶ exit status
 */
#include "../unit.h"
#include <linux/capability.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include "../../../lib/loop/realtime.h"
#include "root_folder.h"

#if defined(__SANITIZE_ADDRESS__)
#define HAS_ASAN 1
#else
#define HAS_ASAN 0
#endif

/* Exit status of a child without the rights for its test. */
#define SKIPPED 77

static const struct incise_realtime_setup fifo = {
	.priority = 80, .cpu = -1, .period_ns = 1000000};
static const struct incise_realtime_setup deadline = {
	.policy = INCISE_REALTIME_DEADLINE, .cpu = -1, .period_ns = 1000000};

/* In a child: print a line and exit. */
#define CHECK(what)                                                                \
	do {                                                                       \
		if (!(what)) {                                                     \
			fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #what); \
			_exit(1);                                                  \
		}                                                                  \
	} while (0)

/* Returns whether the child was not skipped. */
static bool in_child(void (*run)(void))
{
	int status;
	pid_t child = fork();

	assert_true(child >= 0);
	if (!child) {
		run();
		_exit(0);
	}
	assert_int_equal(waitpid(child, &status, 0), child);
	assert_true(WIFEXITED(status));
	if (WEXITSTATUS(status) == SKIPPED)
		return false;
	assert_int_equal(WEXITSTATUS(status), 0);
	return true;
}

TEST(test_refused_setups)
{
	static const struct {
		struct incise_realtime_setup setup;
		int error;
	} rows[] = {
		{{INCISE_REALTIME_FIFO, 0, -1, 1000000}, EINVAL},
		{{INCISE_REALTIME_FIFO, 85, -1, 1000000}, EINVAL},
		{{INCISE_REALTIME_FIFO, -1, -1, 1000000}, EINVAL},
		{{INCISE_REALTIME_FIFO, 80, -2, 1000000}, EINVAL},
		{{INCISE_REALTIME_FIFO, 80, 1024, 1000000}, EINVAL},
		{{INCISE_REALTIME_FIFO, 80, -1, 49999}, EINVAL},
		{{INCISE_REALTIME_FIFO, 80, -1, 1000000001}, EINVAL},
		{{INCISE_REALTIME_FIFO, 80, -1, INT64_MIN}, EINVAL},
		{{(enum incise_realtime_policy)7, 80, -1, 1000000}, EINVAL},
		{{INCISE_REALTIME_DEADLINE, 80, 0, 1000000}, ENOTSUP},
		{{INCISE_REALTIME_DEADLINE, 80, -1, 99999}, EINVAL},
	};

	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		struct incise_realtime_check checks[INCISE_REALTIME_CHECKS];

		assert_error(incise_realtime_new(&rows[i].setup, &err), rows[i].error,
			     &err, NULL);
		assert_int_equal(incise_realtime_checks(&rows[i].setup, checks,
							INCISE_REALTIME_CHECKS),
				 -rows[i].error);
	}
	/* The limits themselves are in range. */
	assert_int_equal(incise_realtime_checks(
				 &(struct incise_realtime_setup){INCISE_REALTIME_FIFO, 84,
								 1023, 50000},
				 NULL, 0),
			 9);
	assert_int_equal(incise_realtime_checks(
				 &(struct incise_realtime_setup){INCISE_REALTIME_DEADLINE,
								 0, -1, 100000},
				 NULL, 0),
			 7);
	incise_realtime_free(NULL);
}

/* Checks change nothing. */
TEST(test_checks_leave_nothing)
{
	struct incise_realtime_check checks[INCISE_REALTIME_CHECKS];
	struct sched_param before, after;
	cpu_set_t cpus, cpus_after;

	assert_int_equal(sched_getaffinity(0, sizeof(cpus), &cpus), 0);
	sched_getparam(0, &before);
	for (int round = 0; round < 20; round++) {
		struct incise_realtime_setup setup = round % 2 ? deadline : fifo;
		int n = incise_realtime_checks(&setup, checks, INCISE_REALTIME_CHECKS);

		assert_int_equal(n, 7);
		assert_string_equal(checks[0].name, "scheduling");
		assert_true(checks[0].ok || *checks[0].found);
	}
	sched_getparam(0, &after);
	assert_int_equal(sched_getscheduler(0), SCHED_OTHER);
	assert_int_equal(after.sched_priority, before.sched_priority);
	assert_int_equal(sched_getaffinity(0, sizeof(cpus), &cpus_after), 0);
	assert_true(CPU_EQUAL(&cpus, &cpus_after));
	/* With a CPU there are two more checks, whether it exists or not. */
	assert_int_equal(incise_realtime_checks(
				 &(struct incise_realtime_setup){
					 .priority = 1, .cpu = 1023, .period_ns = 50000},
				 checks, 0),
			 9);
}

static void drop_rights(void)
{
	struct __user_cap_header_struct header = {_LINUX_CAPABILITY_VERSION_3, 0};
	struct __user_cap_data_struct data[2];
	const struct rlimit none = {0, 0}, little = {65536, 65536};

	CHECK(!syscall(SYS_capget, &header, data));
	data[0].effective &=
		~(1u << CAP_SYS_NICE | 1u << CAP_IPC_LOCK | 1u << CAP_SYS_RESOURCE);
	data[0].permitted &= data[0].effective;
	CHECK(!setrlimit(RLIMIT_RTPRIO, &none));
	CHECK(!setrlimit(RLIMIT_MEMLOCK, &little));
	CHECK(!syscall(SYS_capset, &header, data));
}

static void without_rights(void)
{
	struct incise_realtime_check checks[INCISE_REALTIME_CHECKS];
	struct incise_error err = {0};

	drop_rights();
	CHECK(!incise_realtime_new(&fifo, &err));
	CHECK(errno == EPERM && err.code == EPERM);
	CHECK(strstr(err.text, "RLIMIT_RTPRIO is 0"));
	/* Sanitizers take mlock(2) for done. */
	CHECK(HAS_ASAN || strstr(err.text, "RLIMIT_MEMLOCK is 64 KiB"));
	CHECK(strstr(err.text,
		     "`sudo prlimit --pid $$ --rtprio=90 --memlock=unlimited`"));
	CHECK(!incise_realtime_new(&deadline, &err));
	CHECK(errno == EPERM && strstr(err.text, "CAP_SYS_NICE"));
	CHECK(incise_realtime_checks(&deadline, checks, INCISE_REALTIME_CHECKS) == 7);
	CHECK(!checks[0].ok && checks[0].needed && strstr(checks[0].fix, "sys_nice"));
}

TEST(test_denied)
{
	assert_true(in_child(without_rights));
}

/* The program raises its soft limits itself. */
static void with_soft_limits(void)
{
	struct rlimit limit;
	struct realtime_answers answers;

	CHECK(!getrlimit(RLIMIT_MEMLOCK, &limit));
	limit.rlim_cur = 4096;
	CHECK(!setrlimit(RLIMIT_MEMLOCK, &limit));
	CHECK(!realtime_try(&fifo, &answers));
	CHECK(answers.memlock == limit.rlim_max);
	CHECK(!getrlimit(RLIMIT_MEMLOCK, &limit));
	CHECK(limit.rlim_cur == limit.rlim_max);
}

TEST(test_soft_limits)
{
	assert_true(in_child(with_soft_limits));
}

struct entered {
	const struct incise_realtime *realtime;
	int rc, policy, priority, n_cpus, tid;
	bool sized; /* its stack is what prepare() makes it */
	struct incise_error err;
	struct incise_realtime_counts counts;
};

/* Uses as much stack as a tick may. */
static __attribute__((noinline)) int use_stack(void)
{
	volatile char stack[96 << 10];

	for (size_t i = 0; i < sizeof(stack); i += 512)
		stack[i] = 1;
	return stack[512];
}

static void *enter(void *argument)
{
	struct entered *entered = argument;
	struct incise_realtime_counts before;
	struct sched_param parameters = {0};
	pthread_attr_t attributes;
	size_t size = 0;
	cpu_set_t cpus;

	entered->rc = incise_realtime_enter(entered->realtime, &entered->err);
	entered->tid = (int)syscall(SYS_gettid);
	entered->policy = sched_getscheduler(0) & ~SCHED_RESET_ON_FORK;
	sched_getparam(0, &parameters);
	entered->priority = parameters.sched_priority;
	if (!sched_getaffinity(0, sizeof(cpus), &cpus))
		entered->n_cpus = CPU_COUNT(&cpus);
	if (!pthread_getattr_np(pthread_self(), &attributes)) {
		pthread_attr_getstacksize(&attributes, &size);
		pthread_attr_destroy(&attributes);
	}
	entered->sized = size == 256 << 10;
	/* The first call maps the code itself. */
	incise_realtime_count(entered->tid, &before);
	incise_realtime_count(entered->tid, &before);
	use_stack();
	incise_realtime_count(entered->tid, &entered->counts);
	entered->counts.minor_faults -= before.minor_faults;
	entered->counts.major_faults -= before.major_faults;
	return NULL;
}

static long status_kB(const char *key)
{
	char line[200];
	long kB = -1;
	FILE *in = fopen("/proc/self/status", "r");

	CHECK(in);
	while (fgets(line, sizeof(line), in))
		if (!strncmp(line, key, strlen(key)))
			kB = atol(line + strlen(key) + 1);
	fclose(in);
	return kB;
}

static void *wait_there(void *argument)
{
	/* One heap for all threads: another would map 64 MiB of addresses. */
	free(malloc(100));
	pthread_barrier_wait(argument);
	return NULL;
}

/* Memory that is mapped from now on is resident, too. */
static void map_more(void)
{
	const size_t page = (size_t)sysconf(_SC_PAGESIZE);
	int tid = (int)syscall(SYS_gettid);
	struct incise_realtime_counts before, after;
	volatile char *more;

	more = mmap(NULL, 64 * page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS,
		    -1, 0);
	CHECK(more != MAP_FAILED);
	CHECK(!incise_realtime_count(tid, &before));
	CHECK(!incise_realtime_count(tid, &before));
	for (int i = 0; i < 64; i++)
		more[(size_t)i * page] = 1;
	CHECK(!incise_realtime_count(tid, &after));
	CHECK(after.minor_faults == before.minor_faults);
	munmap((void *)more, 64 * page);
}

static void granted(const struct incise_realtime_setup *setup)
{
	struct incise_error err = {0};
	struct entered entered = {0};
	struct incise_realtime *realtime;
	long size_kB, resident_kB;
	pthread_t loop, others[3];
	pthread_barrier_t barrier;

	incise_realtime_prepare();
	realtime = incise_realtime_new(setup, &err);
	if (!realtime && (errno == EPERM || errno == EBUSY))
		_exit(SKIPPED);
	CHECK(realtime);
	size_kB = status_kB("VmSize");
	resident_kB = status_kB("RssAnon");
	entered.realtime = realtime;
	pthread_barrier_init(&barrier, NULL, 4);
	for (int i = 0; i < 3; i++)
		CHECK(!pthread_create(&others[i], NULL, wait_there, &barrier));
	CHECK(!pthread_create(&loop, NULL, enter, &entered));
	CHECK(!pthread_join(loop, NULL));
	if (entered.rc)
		fprintf(stderr, "%s\n", entered.err.text);
	CHECK(!entered.rc);
	CHECK(entered.sized);
	if (setup->policy == INCISE_REALTIME_FIFO)
		CHECK(entered.policy == SCHED_FIFO &&
		      entered.priority == setup->priority);
	else
		CHECK(entered.policy == 6);
	CHECK(setup->cpu < 0 || entered.n_cpus == 1);
	/* The caller keeps its policy. */
	CHECK(sched_getscheduler(0) == SCHED_OTHER);
	if (!HAS_ASAN) {
		/* All memory is resident, and no page is mapped later. */
		CHECK(status_kB("VmLck") > 1000);
		CHECK(!entered.counts.minor_faults && !entered.counts.major_faults);
		/* A loop and the threads of three devices: four stacks of 256 KiB. */
		CHECK(status_kB("RssAnon") - resident_kB < 2000);
		CHECK(status_kB("VmSize") - size_kB < 6000);
		map_more();
	}
	pthread_barrier_wait(&barrier);
	for (int i = 0; i < 3; i++)
		pthread_join(others[i], NULL);
	incise_realtime_free(realtime);
	CHECK(HAS_ASAN || status_kB("VmLck") == 0);
}

static void granted_fifo(void)
{
	granted(&fifo);
}

static void granted_on_cpu(void)
{
	struct incise_realtime_setup setup = fifo;
	cpu_set_t cpus;

	CHECK(!sched_getaffinity(0, sizeof(cpus), &cpus));
	for (setup.cpu = 0; !CPU_ISSET(setup.cpu, &cpus);)
		setup.cpu++;
	setup.priority = 1;
	granted(&setup);
}

static void granted_deadline(void)
{
	granted(&deadline);
}

TEST(test_granted)
{
	static const struct {
		const char *name;
		void (*run)(void);
	} ways[] = {
		{"SCHED_FIFO", granted_fifo},
		{"SCHED_FIFO on a CPU", granted_on_cpu},
		{"SCHED_DEADLINE", granted_deadline},
	};
	int skipped = 0;

	for (size_t i = 0; i < sizeof(ways) / sizeof(*ways); i++)
		if (!in_child(ways[i].run)) {
			print_message("skipped: %s, which this machine does not grant\n",
				      ways[i].name);
			skipped++;
		}
	if (skipped == 3)
		skip();
}

static void on_no_cpu(void)
{
	struct incise_realtime_setup setup = fifo;
	struct incise_error err = {0};

	setup.cpu = 1023;
	CHECK(!incise_realtime_new(&setup, &err));
	CHECK(strstr(err.text, "CPU 1023 is not available"));
	/* Another denied right may come first. */
	CHECK(errno == EINVAL || errno == EPERM);
}

TEST(test_no_such_cpu)
{
	assert_true(in_child(on_no_cpu));
}

struct small {
	const struct incise_realtime *realtime;
	int rc;
};

static void *enter_small(void *argument)
{
	struct small *small = argument;

	small->rc = incise_realtime_enter(small->realtime, NULL);
	return NULL;
}

/* A small stack does not overflow. */
static void small_stack(void)
{
	struct small small = {incise_realtime_new(&fifo, NULL), 1};
	pthread_attr_t attributes;
	pthread_t thread;

	if (!small.realtime)
		_exit(SKIPPED);
	pthread_attr_init(&attributes);
	pthread_attr_setstacksize(&attributes, 32 << 10);
	CHECK(!pthread_create(&thread, &attributes, enter_small, &small));
	CHECK(!pthread_join(thread, NULL));
	CHECK(!small.rc);
}

/* Of the first thread's large stack only the part for ticks is touched. */
static void large_stack(void)
{
	struct incise_realtime *realtime = incise_realtime_new(&fifo, NULL);

	if (!realtime)
		_exit(SKIPPED);
	CHECK(!incise_realtime_enter(realtime, NULL));
	CHECK(HAS_ASAN || status_kB("VmStk") < 500);
}

TEST(test_stacks)
{
	if (!in_child(small_stack) || !in_child(large_stack))
		skip();
}

#define TID 42
#define STATUS                                      \
	"Name:\tx\nvoluntary_ctxt_switches:\t150\n" \
	"nonvoluntary_ctxt_switches:\t545\n"

TEST(test_counts_table)
{
	static const struct {
		const char *stat, *status;
		int rc;
		struct incise_realtime_counts counts;
	} rows[] = {
		{"42 (incise) S 1 2 3 0 -1 4194560 7 8 9 10 11 12",
		 STATUS,
		 0,
		 {7, 9, 150, 545}},
		/* A thread's name may have any characters. */
		{"42 (a) R 5 (b) ) S 1 2 3 0 -1 4194560 70 8 90 10 11",
		 STATUS,
		 0,
		 {70, 90, 150, 545}},
		{"42 (x) S 1 2 3 0 -1 4194560 18446744073709551615 8 1 0",
		 STATUS,
		 0,
		 {UINT64_MAX, 1, 150, 545}},
		{"42 (x) S 1 2 3 0 -1 4194560 18446744073709551616 8 1 0",
		 STATUS,
		 -EIO,
		 {0}},
		{"42 (x) S 1 2 3 0 -1 4194560 -7 8 9", STATUS, -EIO, {0}},
		{"42 (x) S 1 2 3 0 -1 4194560 7 8", STATUS, -EIO, {0}},
		{"42 (x", STATUS, -EIO, {0}},
		{"42 (x)", STATUS, -EIO, {0}},
		{"", STATUS, -EIO, {0}},
		{"42 (x) S 1 2 3 0 -1 4194560 7 8 9", "", -EIO, {0}},
		{"42 (x) S 1 2 3 0 -1 4194560 7 8 9",
		 "\nvoluntary_ctxt_switches: many\nnonvoluntary_ctxt_switches: 1\n",
		 -EIO,
		 {0}},
		{"42 (x) S 1 2 3 0 -1 4194560 7 8 9",
		 "\nvoluntary_ctxt_switches:\t1\n",
		 -EIO,
		 {0}},
	};
	struct incise_realtime_counts counts;
	struct root_folder root;

	root_folder_make(&root);
	assert_int_equal(realtime_count_below(root.path, TID, &counts), -ESRCH);
	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		memset(&counts, 0xff, sizeof(counts));
		root_folder_say(&root, "/42/stat", rows[i].stat);
		root_folder_say(&root, "/42/status", rows[i].status);
		assert_int_equal(realtime_count_below(root.path, TID, &counts),
				 rows[i].rc);
		assert_memory_equal(&counts, &rows[i].counts, sizeof(counts));
	}
	root_folder_remove(&root);
}

TEST(test_counts_of_own_thread)
{
	const size_t size = 100 * (size_t)sysconf(_SC_PAGESIZE);
	struct incise_realtime_counts before, after;
	struct rusage from, to;
	volatile char *memory;
	int tid = (int)syscall(SYS_gettid);

	memory = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1,
		      0);
	assert_true(memory != MAP_FAILED);
	madvise((void *)memory, size, MADV_NOHUGEPAGE);
	assert_int_equal(incise_realtime_count(tid, &before), 0);
	assert_int_equal(getrusage(RUSAGE_THREAD, &from), 0);
	for (size_t i = 0; i < size; i += size / 100)
		memory[i] = 1;
	/* On a late machine a sleep may end at once. */
	do {
		nanosleep(&(struct timespec){.tv_nsec = 2000000}, NULL);
		assert_int_equal(getrusage(RUSAGE_THREAD, &to), 0);
	} while (to.ru_nvcsw == from.ru_nvcsw);
	assert_int_equal(incise_realtime_count(tid, &after), 0);
	munmap((void *)memory, size);
	/* Our count alone has the sleeps between the two readings. */
	assert_true(after.minor_faults - before.minor_faults >=
		    (uint64_t)(to.ru_minflt - from.ru_minflt));
	assert_true(to.ru_minflt - from.ru_minflt >= 100);
	assert_true(after.minor_faults - before.minor_faults < 200);
	assert_true(after.voluntary - before.voluntary >=
		    (uint64_t)(to.ru_nvcsw - from.ru_nvcsw));
	assert_true(after.involuntary >= before.involuntary);
	assert_true(after.major_faults >= before.major_faults);
}

TEST(test_counts_of_no_thread)
{
	static const int none[] = {-1, 0, INT32_MAX};
	struct incise_realtime_counts counts;

	for (size_t i = 0; i < sizeof(none) / sizeof(*none); i++)
		assert_int_equal(incise_realtime_count(none[i], &counts), -ESRCH);
	/* A thread of another process is not found. */
	assert_int_equal(incise_realtime_count(1, &counts), -ESRCH);
}
