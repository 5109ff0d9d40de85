// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/loop/realtime_counts.c: what proc(5) says of a thread, and what it would never say;
 * and that a real thread's counts are those of getrusage(2).
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <time.h>
#include "../../../lib/loop/realtime.h"
#include "root_folder.h"

#define TID 42
#define STATUS                                      \
	"Name:\tx\nvoluntary_ctxt_switches:\t150\n" \
	"nonvoluntary_ctxt_switches:\t545\n"

static void test_table(void **state)
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
		/* The name of a thread is anything. */
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

static void test_own_thread(void **state)
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
	for (int i = 0; i < 5; i++)
		nanosleep(&(struct timespec){.tv_nsec = 2000000}, NULL);
	assert_int_equal(getrusage(RUSAGE_THREAD, &to), 0);
	assert_int_equal(incise_realtime_count(tid, &after), 0);
	munmap((void *)memory, size);
	/* What lies between ours and its reading is in ours alone. */
	assert_true(after.minor_faults - before.minor_faults >=
		    (uint64_t)(to.ru_minflt - from.ru_minflt));
	assert_true(to.ru_minflt - from.ru_minflt >= 100);
	assert_true(after.minor_faults - before.minor_faults < 200);
	/* A machine that is late wakes it before it sleeps; not each time. */
	assert_true(after.voluntary > before.voluntary);
	assert_true(after.involuntary >= before.involuntary);
	assert_true(after.major_faults >= before.major_faults);
}

static void test_no_such_thread(void **state)
{
	static const int none[] = {-1, 0, INT32_MAX};
	struct incise_realtime_counts counts;

	for (size_t i = 0; i < sizeof(none) / sizeof(*none); i++)
		assert_int_equal(incise_realtime_count(none[i], &counts), -ESRCH);
	/* One of another process is none of ours. */
	assert_int_equal(incise_realtime_count(1, &counts), -ESRCH);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_table),
		cmocka_unit_test(test_own_thread),
		cmocka_unit_test(test_no_such_thread),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
