// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The writer of a state page; see incise/state.h.
 *
 *     loop ─── tick ───▶ page in own memory ─── mirror: a thread, each 5 ms ───▶ file
 *     normal thread ─ run ─▶ ┘                  (and the normal thread at each change)
 *
 * The loop writes private memory: it depends neither on the disk that the file is on, nor on
 * others who change the file or cut it off.
 */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <incise/clock.h>
#include <incise/state.h>
#include "../base/monotonic.h"
#include "../base/vector.h"
#include "../rig/thread.h"
#include "state_file.h"
#include "state_page.h"

_Static_assert(__atomic_always_lock_free(sizeof(uint64_t), 0), "words of 8 bytes");

/* Inlined, so that a copy of a known size is a sequence of moves. */
#define STATE_INLINE static inline __attribute__((always_inline))

STATE_INLINE void state_put(void *to, const void *from, size_t size)
{
	uint64_t *words = to, word;

	for (size_t i = 0; i < size / sizeof(word); i++) {
		memcpy(&word, (const char *)from + i * sizeof(word), sizeof(word));
		__atomic_store_n(words + i, word, __ATOMIC_RELAXED);
	}
}

/* With one writer, no locked operation is needed. */
STATE_INLINE void state_count(uint64_t *counter)
{
	__atomic_store_n(counter, __atomic_load_n(counter, __ATOMIC_RELAXED) + 1,
			 __ATOMIC_RELAXED);
}

/* Copy a part; its first word is seq, which is not taken from the copy. */
STATE_INLINE void state_publish(void *part, const void *from, size_t size)
{
	uint64_t *seq = part;
	uint64_t even = __atomic_load_n(seq, __ATOMIC_RELAXED) & ~(uint64_t)1;

	__atomic_store_n(seq, even + 1, __ATOMIC_RELAXED);
	__atomic_thread_fence(__ATOMIC_RELEASE);
	state_put(seq + 1, (const char *)from + sizeof(*seq), size - sizeof(*seq));
	__atomic_store_n(seq, even + 2, __ATOMIC_RELEASE);
}

/* A sum that stays accurate over 1e9 additions; W. Kahan, CACM 8 (1965) 40. */
struct sum {
	double value, error;
};

static void add_state_writer(struct sum *sum, double value)
{
	double more = value - sum->error;
	double next = sum->value + more;

	sum->error = (next - sum->value) - more;
	sum->value = next;
}

/* No hand does more work between two ticks; more would saturate the sums. */
#define WORK_MAX_mJ 1e9

/*
 * The work of hand and tissue on each other, mJ (N·mm).
 *
 *     tick      k-1             k
 *     force    f(k-1) ────────▶          held between them
 *     tool     x(k-1)          x(k)      work on the tissue: -f(k-1)·(x(k) - x(k-1))
 */
struct state_writer_work {
	struct sum absorbed; /* by the tissue */
	struct sum returned; /* to the hand; ≥ 0 */
	double tool_mm[3], force_N[3];
	enum incise_tool tool;
	bool known; /* tool_mm and force_N of the last tick */
};

static void add_work(struct state_writer_work *work, const struct incise_tick *tick)
{
	bool known = !(tick->flags & (INCISE_TICK_STALE | INCISE_TICK_FAULT));
	double way_mm[3], work_mJ;

	/* A change of the tool is no motion. */
	if (known && work->known && tick->tool == work->tool) {
		v3_sub(way_mm, tick->tool_mm, work->tool_mm);
		work_mJ = -v3_dot(work->force_N, way_mm);
		if (work_mJ > 0 && work_mJ < WORK_MAX_mJ)
			add_state_writer(&work->absorbed, work_mJ);
		else if (work_mJ < 0 && work_mJ > -WORK_MAX_mJ)
			add_state_writer(&work->returned, -work_mJ);
	}
	v3_copy(work->tool_mm, tick->tool_mm);
	v3_copy(work->force_N, tick->command_N);
	work->tool = tick->tool;
	work->known = known;
}

/* The file, which the mirror alone writes. */
struct mirror {
	struct incise_state_file file;
	pthread_mutex_t lock; /* of all this; the loop never takes it */
	pthread_t thread;
	bool has_thread;
	atomic_bool stop;
	uint64_t run_seq, live_seq; /* of the parts that the file has */
	uint64_t ticks;		    /* in its ring, and before */
};

struct incise_state_writer {
	struct state_page *page;
	struct state_run run; /* the normal thread's */
	bool has_scene;
	int64_t running_ns; /* when it started to run */
	struct mirror mirror;
	/* The loop's, on cache lines of its own. */
	_Alignas(64) struct state_live live;
	struct state_writer_work work;
	uint64_t written;
};

/* Printable, and cut between characters. */
static void put_state_writer_text(char *to, size_t size, const char *text)
{
	size_t n = text ? strlen(text) : 0;

	if (n >= size) {
		n = size - 1;
		while (n && ((unsigned char)text[n] & 0xc0) == 0x80)
			n--;
	}
	memset(to, 0, size);
	for (size_t i = 0; i < n; i++)
		to[i] = (unsigned char)text[i] < ' ' || text[i] == 0x7f ? '?' : text[i];
}

/* Keep the end of a long path. */
static void put_path(char *to, size_t size, const char *path)
{
	size_t n = path ? strlen(path) : 0;

	if (n >= size) {
		path += n - (size - 4);
		while (((unsigned char)*path & 0xc0) == 0x80)
			path++;
		put_state_writer_text(to, size - 3, path);
		memmove(to + 3, to, size - 3);
		memcpy(to, "...", 3);
	} else {
		put_state_writer_text(to, size, path);
	}
}

static struct state_part part(size_t offset, size_t size, size_t count)
{
	return (struct state_part){.offset = offset, .size = size, .count = count};
}

static void put_head(struct state_head *head, const struct incise_state_setup *setup)
{
	head->start_realtime_ns = incise_read_clock_ns(CLOCK_REALTIME);
	head->start_ns = incise_monotonic_ns();
	head->major = STATE_MAJOR;
	head->minor = STATE_MINOR;
	head->size = sizeof(struct state_page);
	head->head = part(0, sizeof(*head), 1);
	head->run = part(offsetof(struct state_page, run), sizeof(struct state_run), 1);
	head->live =
		part(offsetof(struct state_page, live), sizeof(struct state_live), 1);
	head->lateness = part(offsetof(struct state_page, lateness), sizeof(uint64_t),
			      INCISE_STATE_BUCKETS);
	head->cost = part(offsetof(struct state_page, cost), sizeof(uint64_t),
			  INCISE_STATE_BUCKETS);
	head->ring = part(offsetof(struct state_page, written), sizeof(struct state_slot),
			  INCISE_STATE_TICKS);
	head->pid = getpid();
	head->rate_hz = setup->rate_hz;
	put_state_writer_text(head->rig, sizeof(head->rig), setup->rig);
	put_state_writer_text(head->policy, sizeof(head->policy), setup->policy);
	memcpy(head->magic, STATE_MAGIC, sizeof(head->magic));
}

/* --- the mirror --------------------------------------------------------------------- */

#define MIRROR_NS 5000000
/* The loop writes a part in some 30 ns, once a tick: more tries are of no use. */
#define TRIES 100

static void mirror_put(struct mirror *m, size_t offset, const void *from, size_t size)
{
	/* A full disk, say: the missing part is written once there is room. */
	incise_state_file_write(&m->file, offset, from, size);
}

static void state_take(void *to, const void *from, size_t size)
{
	const uint64_t *words = from;

	for (size_t i = 0; i < size / sizeof(*words); i++) {
		uint64_t word = __atomic_load_n(words + i, __ATOMIC_RELAXED);

		memcpy((char *)to + i * sizeof(word), &word, sizeof(word));
	}
}

/* A whole copy of a part, whose first word is seq. False: the loop is in the middle of it. */
static bool take_part(void *to, const void *part, size_t size)
{
	const uint64_t *seq = part;

	for (int i = 0; i < TRIES; i++) {
		uint64_t before = __atomic_load_n(seq, __ATOMIC_ACQUIRE);

		state_take(to, part, size);
		__atomic_thread_fence(__ATOMIC_ACQUIRE);
		if (!(before & 1) && __atomic_load_n(seq, __ATOMIC_RELAXED) == before) {
			memcpy(to, &before, sizeof(before));
			return true;
		}
	}
	return false;
}

/* Copy a part that is newer than @last. Returns whether it was. */
static bool mirror_part(struct mirror *m, size_t offset, void *copy, const void *part,
			size_t size, uint64_t *last)
{
	uint64_t seq, odd;

	if (!take_part(copy, part, size))
		return false;
	memcpy(&seq, copy, sizeof(seq));
	if (seq == *last)
		return false;
	odd = seq - 1;
	mirror_put(m, offset, &odd, sizeof(odd));
	mirror_put(m, offset + sizeof(odd), (char *)copy + sizeof(odd),
		   size - sizeof(odd));
	mirror_put(m, offset, &seq, sizeof(seq));
	*last = seq;
	return true;
}

static void mirror_times(struct mirror *m, size_t offset, const uint64_t *counts)
{
	uint64_t copy[INCISE_STATE_BUCKETS];

	state_take(copy, counts, sizeof(copy));
	mirror_put(m, offset, copy, sizeof(copy));
}

/* A slot with the tick of that number, or without a tick: it has been overwritten. */
static bool take_slot(const struct state_page *page, uint64_t tick,
		      struct state_slot *copy)
{
	const struct state_slot *slot = &page->slot[tick % INCISE_STATE_TICKS];

	state_take(copy, slot, sizeof(*copy));
	__atomic_thread_fence(__ATOMIC_ACQUIRE);
	if (copy->number == tick + 1 &&
	    __atomic_load_n(&page->written, __ATOMIC_RELAXED) - tick < INCISE_STATE_TICKS)
		return true;
	*copy = (struct state_slot){0};
	return false;
}

/*
 * The ticks since the last time, one by one: as the loop does it, the number of ticks is raised
 * before a slot is used again.
 */
static void mirror_ticks(struct incise_state_writer *w)
{
	struct mirror *m = &w->mirror;
	uint64_t written = __atomic_load_n(&w->page->written, __ATOMIC_ACQUIRE), next;
	const size_t offset = offsetof(struct state_page, written);

	if (written - m->ticks > INCISE_STATE_TICKS)
		m->ticks = written - INCISE_STATE_TICKS;
	for (; m->ticks < written; m->ticks = next) {
		struct state_slot slot;

		next = m->ticks + 1;
		if (take_slot(w->page, m->ticks, &slot))
			mirror_put(m,
				   offsetof(struct state_page,
					    slot[m->ticks % INCISE_STATE_TICKS]),
				   &slot, sizeof(slot));
		mirror_put(m, offset, &next, sizeof(next));
	}
}

/*
 * The page ends with bytes of no use. They are written last: no other write of the mirror makes a
 * file that was cut off as long as a whole one.
 */
_Static_assert(sizeof(struct state_page) > offsetof(struct state_page, slot) +
						   sizeof(((struct state_page *)0)->slot),
	       "bytes behind the slots");

/* The ring from its beginning to its end, in which readers miss what is not yet there. */
static void mirror_ring(struct incise_state_writer *w)
{
	struct mirror *m = &w->mirror;
	uint64_t written = __atomic_load_n(&w->page->written, __ATOMIC_ACQUIRE);

	mirror_put(m, offsetof(struct state_page, written), &written, sizeof(written));
	for (uint64_t i = 0; i < INCISE_STATE_TICKS; i++) {
		/* The last tick before @written in that slot. */
		uint64_t back = (written - i - 1) % INCISE_STATE_TICKS + 1;
		struct state_slot slot = {0};

		if (back <= written)
			take_slot(w->page, written - back, &slot);
		mirror_put(m, offsetof(struct state_page, slot[i]), &slot, sizeof(slot));
	}
	mirror_put(m, sizeof(*w->page) - 1, "", 1);
	m->ticks = written;
}

void incise_state_mirror(struct incise_state_writer *w)
{
	struct mirror *m = &w->mirror;
	struct state_run run;
	struct state_live live;
	bool all;

	pthread_mutex_lock(&m->lock);
	/* In the order of the file, so that its size says how much of it is whole. */
	all = incise_state_file_short(m->file.fd, sizeof(*w->page));
	if (all) {
		m->run_seq = m->live_seq = 0;
		mirror_put(m, 0, &w->page->head, sizeof(w->page->head));
	}
	mirror_part(m, offsetof(struct state_page, run), &run, &w->page->run, sizeof(run),
		    &m->run_seq);
	if (mirror_part(m, offsetof(struct state_page, live), &live, &w->page->live,
			sizeof(live), &m->live_seq) ||
	    all) {
		mirror_times(m, offsetof(struct state_page, lateness), w->page->lateness);
		mirror_times(m, offsetof(struct state_page, cost), w->page->cost);
	}
	if (all)
		mirror_ring(w);
	mirror_ticks(w);
	pthread_mutex_unlock(&m->lock);
}

static void *run_mirror(void *argument)
{
	const struct timespec period = {.tv_nsec = MIRROR_NS};
	struct incise_state_writer *w = argument;

	while (!atomic_load(&w->mirror.stop)) {
		incise_state_mirror(w);
		nanosleep(&period, NULL);
	}
	return NULL;
}

/* --- the page ------------------------------------------------------------------------- */

static void publish_run(struct incise_state_writer *w)
{
	state_publish(&w->page->run, &w->run, sizeof(w->run));
	incise_state_mirror(w);
}

static void free_writer(struct incise_state_writer *w)
{
	struct mirror *m;

	if (!w)
		return;
	m = &w->mirror;
	atomic_store(&m->stop, true);
	if (m->has_thread)
		pthread_join(m->thread, NULL);
	incise_state_file_close(&m->file);
	pthread_mutex_destroy(&m->lock);
	free(w->page);
	free(w);
}

struct incise_state_writer *incise_state_new(const char *path,
					     const struct incise_state_setup *setup,
					     struct incise_error *err)
{
	struct incise_state_writer *w;
	struct mirror *m;
	int rc;

	if (!(setup->rate_hz > 0) || !isfinite(setup->rate_hz))
		return INCISE_ERROR_NULL(err, EINVAL,
					 "the loop's rate is %g Hz: expected more than 0",
					 setup->rate_hz);
	w = aligned_alloc(64, sizeof(*w));
	if (!w)
		goto no_memory;
	memset(w, 0, sizeof(*w));
	m = &w->mirror;
	m->file.fd = -1;
	pthread_mutex_init(&m->lock, NULL);
	w->page = aligned_alloc(64, sizeof(*w->page));
	if (!w->page)
		goto no_memory;
	/* Written once here, pages cost the loop no fault. */
	memset(w->page, 0, sizeof(*w->page));
	if (incise_state_file_new(&m->file, path, sizeof(*w->page), err))
		goto failed;
	put_head(&w->page->head, setup);
	mirror_put(m, 0, &w->page->head, sizeof(w->page->head));
	incise_state_run(w, INCISE_RUN_STARTING, NULL);
	if (incise_state_file_publish(&m->file, err))
		goto failed;
	rc = incise_thread_start(&m->thread, run_mirror, w, NULL);
	m->has_thread = !rc;
	if (!rc)
		return w;
	incise_error_set(err, -rc, "%s: no thread to write it: %s", path, strerror(-rc));
	goto failed;
no_memory:
	incise_error_set(err, ENOMEM, "%s: no memory for the loop's state", path);
failed:
	rc = errno;
	free_writer(w);
	errno = rc;
	return NULL;
}

/*
 * Tick n takes the slot of tick n - slots. A reader checks the number of ticks after its copy:
 * that number was raised before any word of the next tick was written.
 */
static void put_slot(struct incise_state_writer *w, const struct state_tick *tick)
{
	struct state_slot *slot = &w->page->slot[w->written % INCISE_STATE_TICKS];

	__atomic_thread_fence(__ATOMIC_RELEASE);
	__atomic_store_n(&slot->number, w->written + 1, __ATOMIC_RELAXED);
	state_put(&slot->tick, tick, sizeof(*tick));
	w->written++;
	__atomic_store_n(&w->page->written, w->written, __ATOMIC_RELEASE);
}

static void count_tick(struct state_live *live, const struct incise_tick *tick,
		       uint64_t skipped)
{
	double force_N = v3_length(tick->command_N);

	if (!live->ticks++)
		live->first_ns = tick->t_ns;
	live->skipped += skipped;
	live->overruns += !!skipped;
	live->limited += !!(tick->flags & (INCISE_TICK_CLAMPED | INCISE_TICK_SLEWED));
	for (int i = 0; i < INCISE_TICK_FLAGS; i++)
		live->flagged[i] += tick->flags >> i & 1;
	live->force_N = force_N;
	if (force_N > live->force_max_N)
		live->force_max_N = force_N;
}

static void count_times(struct state_live *live, int64_t lateness_ns, int64_t cost_ns)
{
	live->lateness_ns = lateness_ns;
	live->cost_ns = cost_ns;
	live->lateness_sum_ns += (uint64_t)lateness_ns;
	live->cost_sum_ns += (uint64_t)cost_ns;
	if (lateness_ns > live->lateness_max_ns)
		live->lateness_max_ns = lateness_ns;
	if (cost_ns > live->cost_max_ns)
		live->cost_max_ns = cost_ns;
}

void incise_state_tick(struct incise_state_writer *w, const struct incise_tick *tick,
		       int64_t lateness_ns, int64_t cost_ns, uint64_t skipped)
{
	if (!w)
		return;
	if (lateness_ns < 0)
		lateness_ns = 0;
	if (cost_ns < 0)
		cost_ns = 0;
	count_tick(&w->live, tick, skipped);
	count_times(&w->live, lateness_ns, cost_ns);
	add_work(&w->work, tick);
	w->live.absorbed_mJ = w->work.absorbed.value;
	w->live.returned_mJ = w->work.returned.value;
	incise_state_pack(&w->live.tick, tick);
	state_count(&w->page->lateness[incise_state_bucket(lateness_ns)]);
	state_count(&w->page->cost[incise_state_bucket(cost_ns)]);
	put_slot(w, &w->live.tick);
	state_publish(&w->page->live, &w->live, sizeof(w->live));
}

void incise_state_run(struct incise_state_writer *w, enum incise_run run,
		      const char *reason)
{
	if (!w)
		return;
	if ((uint32_t)run != w->run.run || !w->run.since_ns)
		w->run.since_ns = incise_monotonic_ns();
	/* It kept running while it read another scene. */
	if (run == INCISE_RUN_RUNNING && w->run.run == INCISE_RUN_RELOADING)
		w->run.since_ns = w->running_ns;
	else if (run == INCISE_RUN_RUNNING)
		w->running_ns = w->run.since_ns;
	w->run.run = (uint32_t)run;
	put_state_writer_text(w->run.reason, 300, reason);
	publish_run(w);
}

void incise_state_scene(struct incise_state_writer *w, const char *path,
			const struct incise_plan *plan)
{
	const char *name, *why;
	uint32_t n = 0;

	if (!w)
		return;
	put_path(w->run.scene, sizeof(w->run.scene), path);
	memset(w->run.stage, 0, sizeof(w->run.stage));
	while (plan && n < STATE_STAGES && (name = incise_plan_stage(plan, n))) {
		put_state_writer_text(w->run.stage[n], sizeof(w->run.stage[n]), name);
		n++;
	}
	w->run.n_stages = n;
	w->run.left_out = 0;
	while (plan && incise_plan_left_out(plan, (int)w->run.left_out, &why))
		w->run.left_out++;
	w->run.reloads += w->has_scene;
	w->has_scene = true;
	publish_run(w);
}

void incise_state_refused(struct incise_state_writer *w, const char *reason)
{
	if (!w)
		return;
	w->run.refused++;
	put_state_writer_text(w->run.reason, 300, reason);
	publish_run(w);
}

void incise_state_counts(struct incise_state_writer *w,
			 const struct incise_realtime_counts *counts)
{
	if (!w)
		return;
	w->run.minor_faults = counts->minor_faults;
	w->run.major_faults = counts->major_faults;
	w->run.voluntary = counts->voluntary;
	w->run.involuntary = counts->involuntary;
	publish_run(w);
}

void incise_state_free(struct incise_state_writer *w)
{
	if (!w)
		return;
	incise_state_mirror(w);
	free_writer(w);
}
