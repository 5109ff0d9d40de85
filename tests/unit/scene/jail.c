// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A tick allocates nothing and calls no system: it runs in a process that the kernel ends
 * at any call but read, write and _exit, and that counts allocations.
 *
 *     test ── fork ──▶ child: prepare ──▶ seccomp strict ──▶ ticks ──▶ write ──▶ SYS_exit
 *       ▲                                                               │
 *       └───────────────────────── pipe: what it came to ◀──────────────┘
 *
 * mk/test.mk lets the linker send the allocations of this program here (--wrap).
 */
#include "../unit.h"
#include <signal.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include "../../extremes/ground.h"

#define MS 1000000
#define TICKS 5000 /* on each of four scenes */

static long allocations;

void *__real_malloc(size_t size);
void *__real_calloc(size_t n, size_t size);
void *__real_realloc(void *old, size_t size);
void __real_free(void *old);

void *__wrap_malloc(size_t size)
{
	allocations++;
	return __real_malloc(size);
}

void *__wrap_calloc(size_t n, size_t size)
{
	allocations++;
	return __real_calloc(n, size);
}

void *__wrap_realloc(void *old, size_t size)
{
	allocations++;
	return __real_realloc(old, size);
}

void __wrap_free(void *old)
{
	allocations++;
	__real_free(old);
}

/* The report of a child process. */
struct reported {
	long ticks, contacts, insertions, stale, free, allocations;
	double force_N; /* largest */
};

/* Strokes through the top, with blade, handle and tube, and a stall of the tracker. */
static void run(struct incise_plan *plan, const struct incise_touch *top,
		struct reported *reported)
{
	for (int i = 0; i < TICKS; i++) {
		struct incise_tracker_sample s = {
			.t_ns = 1000000000 + (int64_t)i * MS,
			.quaternion = {1},
			.status = ' ',
		};
		double height_mm = 10 * cos(i * 0.01), force_N = 0;
		struct incise_tick t;

		for (int k = 0; k < 3; k++)
			s.position_mm[k] = top->point_mm[k] + height_mm * top->normal[k];
		s.position_mm[0] += 5 * sin(i * 0.007);
		/* A pose that jumps now and then. */
		if (i % 100 == 7)
			s.position_mm[1] += 1000;
		if (i % 8 == 7 && i % 1000 < 900)
			incise_plan_feed(plan, &s, 1);
		if (i % 500 == 0)
			incise_plan_set_tool(plan, (enum incise_tool)(i / 500 % 4));
		if (incise_plan_tick(plan, s.t_ns, &t))
			return;
		reported->ticks++;
		reported->contacts += !!(t.flags & INCISE_TICK_CONTACT);
		reported->insertions += t.phase == INCISE_PHASE_INSERTION;
		reported->free += t.phase == INCISE_PHASE_FREE;
		reported->stale += !!(t.flags & INCISE_TICK_STALE);
		for (int k = 0; k < 3; k++)
			force_N += t.command_N[k] * t.command_N[k];
		reported->force_N = fmax(reported->force_N, sqrt(force_N));
	}
}

/* A jailed process cannot use glibc's _exit(), which calls exit_group. */
static void leave(int code)
{
	for (;;)
		syscall(SYS_exit, code);
}

struct prepared {
	struct incise_scene *scene;
	struct incise_plan *plan;
	struct incise_touch top;
};

/* In the child; does not return. */
static void jailed(struct prepared *prepared, int n, bool break_out, int out)
{
	struct reported reported = {0};

	if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT))
		leave(77);
	allocations = 0;
	for (int i = 0; i < n; i++)
		run(prepared[i].plan, &prepared[i].top, &reported);
	reported.allocations = allocations;
	if (break_out)
		syscall(SYS_getppid);
	leave(write(out, &reported, sizeof(reported)) != sizeof(reported));
}

/* Returns the child's status as of waitpid(2). */
static int run_jailed(struct prepared *prepared, int n, bool break_out,
		      struct reported *reported)
{
	int ends[2], status;
	ssize_t got;
	pid_t child;

	memset(reported, 0, sizeof(*reported));
	assert_int_equal(pipe(ends), 0);
	child = fork();
	assert_true(child >= 0);
	if (!child)
		jailed(prepared, n, break_out, ends[1]);
	close(ends[1]);
	got = read(ends[0], reported, sizeof(*reported));
	close(ends[0]);
	assert_int_equal(waitpid(child, &status, 0), child);
	if (WIFEXITED(status) && WEXITSTATUS(status) == 0)
		assert_int_equal(got, sizeof(*reported));
	return status;
}

TEST(test_ticks_in_jail)
{
	static const char *const names[] = {"plane", "large mesh"};
	struct prepared prepared[4];
	struct reported reported, none;
	int n, status, broken;
	bool no_jail;

	for (n = 0; n < 4; n++) {
		const struct ground *ground = ground_of(names[n / 2]);
		struct prepared *p = &prepared[n];

		/* A model on the plane in fixed point, and on the mesh in double. */
		p->scene = ground_scene(ground, n % 2 == 0, n == 0 || n == 3);
		p->plan = ground_plan(p->scene);
		incise_plan_top(p->plan, &p->top);
	}
	/* The counter counts: models, meshes and plans were made. */
	assert_true(allocations > 20);

	status = run_jailed(prepared, n, false, &reported);
	broken = run_jailed(prepared, n, true, &none);
	for (int i = 0; i < n; i++) {
		incise_plan_free(prepared[i].plan);
		incise_scene_free(prepared[i].scene);
	}
	no_jail = WIFEXITED(status) && WEXITSTATUS(status) == 77;
	if (no_jail) {
		print_message("skipped: jail, this kernel has no strict seccomp\n");
		skip();
	}
	if (WIFSIGNALED(status))
		fail_msg("a tick called the system, or worse: signal %d",
			 WTERMSIG(status));
	assert_true(WIFEXITED(status));
	assert_int_equal(WEXITSTATUS(status), 0);
	assert_int_equal(reported.ticks, n * TICKS);
	assert_int_equal(reported.allocations, 0);
	/* They did all that ticks do. */
	assert_true(reported.contacts > TICKS && reported.free > TICKS);
	assert_true(reported.insertions > TICKS / 10);
	assert_true(reported.stale > 100);
	assert_true(reported.force_N > 1 && reported.force_N <= GROUND_FORCE_N);
	/* And the jail is one: getppid(2), which does nothing, was the end. */
	assert_true(WIFSIGNALED(broken));
	assert_int_equal(WTERMSIG(broken), SIGKILL);
	assert_int_equal(none.ticks, 0);
}
