// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The reader of a state page; see incise/state.h.
 *
 * It copies by pread(2), so that a truncated file is a short read and no signal, and checks its
 * copy, which no other process can change. Its loads happen in the order of the calls: a fence
 * also orders the kernel's loads in them. Aligned words of 8 bytes are copied whole; a seq that
 * was not would differ when it is read again.
 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include <incise/state.h>
#include "state_file.h"
#include "state_page.h"

/* A write takes some 30 ns: after so many tries the writer must have stopped in the middle. */
#define TRIES 100
#define OPENS 1000	/* 1 ms apart: a page that was cut off is whole again after 5 */
#define CHUNK 64	/* slots at a time */
#define ENTRY_MAX 65536 /* bytes of any part or slot: far more than needed */
#define COUNT_MAX (1 << 24)

struct incise_state {
	int fd;
	struct state_head head;
	unsigned char *slots; /* CHUNK */
};

const char *incise_run_name(enum incise_run run)
{
	static const char *const names[INCISE_RUNS] = {
		"starting", "running", "reloading", "stopping", "stopped", "fault",
	};

	return (unsigned int)run < INCISE_RUNS ? names[run] : "unknown";
}

/* -EIO: the file was cut off; -EAGAIN: its writer lives, and writes it anew. */
static int cut_off(const struct incise_state *state)
{
	return incise_state_file_held(state->fd) == 1 ? -EAGAIN : -EIO;
}

/* The copies before this are of a whole file, or its writer has ended. Returns 0 or -EAGAIN. */
static int check_whole(const struct incise_state *state)
{
	if (!incise_state_file_short(state->fd, state->head.size))
		return 0;
	return cut_off(state) == -EAGAIN ? -EAGAIN : 0;
}

/* Returns 0, or as cut_off(). */
static int copy(const struct incise_state *state, void *to, size_t size, uint64_t offset)
{
	ssize_t n;

	do
		n = pread(state->fd, to, size, (off_t)offset);
	while (n < 0 && errno == EINTR);
	return n == (ssize_t)size ? 0 : cut_off(state);
}

static bool sound_part(const struct state_part *part, uint64_t size, uint64_t count,
		       uint64_t end)
{
	return !(part->offset % 8) && !(part->size % 8) && part->size >= size &&
	       part->size <= ENTRY_MAX && part->count >= count &&
	       part->count <= COUNT_MAX && part->offset <= end &&
	       part->size * part->count <= end - part->offset;
}

static bool sound_head(const struct state_head *head, uint64_t size)
{
	/* The number of ticks precedes the slots. */
	const struct state_part slots = {head->ring.offset + sizeof(uint64_t),
					 head->ring.size, head->ring.count};
	const uint64_t word = sizeof(uint64_t);

	return head->size <= size &&
	       sound_part(&head->head, sizeof(*head), 1, head->size) &&
	       sound_part(&head->run, sizeof(struct state_run), 1, head->size) &&
	       sound_part(&head->live, sizeof(struct state_live), 1, head->size) &&
	       head->lateness.size == word && head->cost.size == word &&
	       head->lateness.count == INCISE_STATE_BUCKETS &&
	       head->cost.count == INCISE_STATE_BUCKETS &&
	       sound_part(&head->lateness, word, INCISE_STATE_BUCKETS, head->size) &&
	       sound_part(&head->cost, word, INCISE_STATE_BUCKETS, head->size) &&
	       head->ring.offset < head->size &&
	       sound_part(&slots, sizeof(struct state_slot), 1, head->size) &&
	       isfinite(head->rate_hz) && head->rate_hz > 0;
}

static int read_head(struct incise_state *state, const char *path,
		     struct incise_error *err)
{
	struct state_head *head = &state->head;
	struct stat st;

	if (fstat(state->fd, &st))
		return incise_error_set(err, errno, "%s: %s", path, strerror(errno));
	if (!S_ISREG(st.st_mode) || copy(state, head, sizeof(*head), 0) ||
	    memcmp(head->magic, STATE_MAGIC, sizeof(head->magic)))
		return incise_error_set(err, EINVAL,
					"%s: not a status file of a loop; expected for "
					"example /run/incise/NAME.state",
					path);
	if (head->major != STATE_MAJOR)
		return incise_error_set(err, EPROTO,
					"%s: a status file of version %u.%u, but this "
					"program reads %d; use programs of one release",
					path, head->major, head->minor, STATE_MAJOR);
	if (!sound_head(head, (uint64_t)st.st_size))
		return incise_error_set(err, EINVAL,
					"%s: damaged or truncated; start the loop again",
					path);
	return 0;
}

struct incise_state *incise_state_open(const char *path, struct incise_error *err)
{
	const struct timespec pause = {.tv_nsec = 1000000};
	struct incise_state *state = calloc(1, sizeof(*state));
	int rc;

	if (!state)
		goto no_memory;
	/* A pipe would wait for a writer. */
	state->fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
	if (state->fd < 0) {
		incise_error_set(err, errno, "%s: %s", path, strerror(errno));
		free(state);
		return NULL;
	}
	rc = read_head(state, path, err);
	for (int i = 0; i < OPENS && rc && incise_state_file_held(state->fd) == 1; i++) {
		nanosleep(&pause, NULL);
		rc = read_head(state, path, err);
	}
	if (rc)
		goto failed;
	state->slots = malloc(CHUNK * state->head.ring.size);
	if (state->slots)
		return state;
	close(state->fd);
no_memory:
	free(state);
	return INCISE_ERROR_NULL(err, ENOMEM, "%s: no memory to read it", path);
failed:
	close(state->fd);
	free(state);
	/* close() may have changed errno. */
	errno = err ? err->code : EINVAL;
	return NULL;
}

void incise_state_close(struct incise_state *state)
{
	if (!state)
		return;
	close(state->fd);
	free(state->slots);
	free(state);
}

int incise_state_alive(struct incise_state *state)
{
	int held = incise_state_file_held(state->fd);

	return held < 0 ? -EIO : held;
}

/* Returns 0, -EAGAIN, -EIO. */
static int try_part(const struct incise_state *state, uint64_t offset, void *to,
		    size_t size)
{
	uint64_t before, after;

	int rc = copy(state, &before, sizeof(before), offset);

	__atomic_thread_fence(__ATOMIC_ACQUIRE);
	if (!rc)
		rc = copy(state, to, size, offset);
	__atomic_thread_fence(__ATOMIC_ACQUIRE);
	if (!rc)
		rc = copy(state, &after, sizeof(after), offset);
	if (rc)
		return rc;
	return before == after && !(before & 1) ? 0 : -EAGAIN;
}

/* A part that a dead writer left half written is returned as it is. */
static int read_part(struct incise_state *state, uint64_t offset, void *to, size_t size,
		     struct incise_state_now *now)
{
	int rc, alive;

	for (int i = 0; i < TRIES; i++) {
		rc = try_part(state, offset, to, size);
		if (rc != -EAGAIN)
			return rc;
		if (!now->alive)
			break;
	}
	alive = incise_state_alive(state);
	if (alive)
		return alive < 0 ? -EIO : -EAGAIN;
	now->alive = false;
	/* It may have ended properly just now. */
	rc = try_part(state, offset, to, size);
	now->torn |= rc == -EAGAIN;
	return rc == -EAGAIN ? 0 : rc;
}

/* A terminated, printable string. */
static void take_state_reader_text(char *to, size_t size, const char *from,
				   size_t capacity)
{
	size_t n = strnlen(from, capacity < size ? capacity : size - 1);

	memset(to, 0, size);
	for (size_t i = 0; i < n; i++)
		to[i] = (unsigned char)from[i] < ' ' || from[i] == 0x7f ? '?' : from[i];
}

static void take_head(struct incise_state_now *now, const struct state_head *head)
{
	now->pid = head->pid;
	now->start_ns = head->start_ns;
	now->start_realtime_ns = head->start_realtime_ns;
	now->rate_hz = head->rate_hz;
	take_state_reader_text(now->rig, sizeof(now->rig), head->rig, sizeof(head->rig));
	take_state_reader_text(now->policy, sizeof(now->policy), head->policy,
			       sizeof(head->policy));
}

static int take_run(struct incise_state_now *now, const struct state_run *run)
{
	if (run->run >= INCISE_RUNS || run->n_stages > STATE_STAGES)
		return -EIO;
	now->run = (enum incise_run)run->run;
	now->since_ns = run->since_ns;
	take_state_reader_text(now->reason, sizeof(now->reason), run->reason,
			       sizeof(run->reason));
	take_state_reader_text(now->scene, sizeof(now->scene), run->scene,
			       sizeof(run->scene));
	now->n_stages = (int)run->n_stages;
	for (int i = 0; i < now->n_stages; i++)
		take_state_reader_text(now->stage[i], sizeof(now->stage[i]),
				       run->stage[i], sizeof(run->stage[i]));
	now->left_out =
		(int)(run->left_out < COUNT_MAX ? run->left_out : (uint64_t)COUNT_MAX);
	now->reloads = run->reloads;
	now->refused = run->refused;
	now->minor_faults = run->minor_faults;
	now->major_faults = run->major_faults;
	now->voluntary = run->voluntary;
	now->involuntary = run->involuntary;
	return 0;
}

static int take_live(struct incise_state_now *now, const struct state_live *live)
{
	now->ticks = live->ticks;
	now->skipped = live->skipped;
	now->overruns = live->overruns;
	now->limited = live->limited;
	for (int i = 0; i < INCISE_TICK_FLAGS; i++)
		now->flagged[i] = live->flagged[i];
	now->force_N = live->force_N;
	now->force_max_N = live->force_max_N;
	now->lateness_ns = live->lateness_ns;
	now->lateness_max_ns = live->lateness_max_ns;
	now->cost_ns = live->cost_ns;
	now->cost_max_ns = live->cost_max_ns;
	now->lateness_sum_ns = live->lateness_sum_ns;
	now->cost_sum_ns = live->cost_sum_ns;
	now->absorbed_mJ = live->absorbed_mJ;
	now->returned_mJ = live->returned_mJ;
	now->first_ns = live->first_ns;
	return incise_state_unpack(&now->tick, &live->tick);
}

int incise_state_read(struct incise_state *state, struct incise_state_now *now)
{
	const struct state_head *head = &state->head;
	struct state_run run;
	struct state_live live;
	int rc = incise_state_alive(state);

	memset(now, 0, sizeof(*now));
	if (rc < 0)
		return rc;
	now->alive = rc;
	take_head(now, head);
	rc = read_part(state, head->run.offset, &run, sizeof(run), now);
	if (!rc)
		rc = take_run(now, &run);
	if (!rc)
		rc = read_part(state, head->live.offset, &live, sizeof(live), now);
	if (!rc)
		rc = take_live(now, &live);
	if (!rc)
		rc = copy(state, &now->lateness, sizeof(now->lateness),
			  head->lateness.offset);
	if (!rc)
		rc = copy(state, &now->cost, sizeof(now->cost), head->cost.offset);
	return rc ? rc : check_whole(state);
}

/* Ticks first … first + n, in adjacent slots; returns the number of valid ones, or as copy(). */
static int take_slots(struct incise_state *state, uint64_t first, uint64_t n,
		      struct incise_tick *ticks)
{
	const struct state_part *ring = &state->head.ring;
	const uint64_t slots = ring->offset + sizeof(uint64_t);
	uint64_t written;
	int good = 0;
	int rc = copy(state, state->slots, n * ring->size,
		      slots + first % ring->count * ring->size);

	__atomic_thread_fence(__ATOMIC_ACQUIRE);
	if (!rc)
		rc = copy(state, &written, sizeof(written), ring->offset);
	if (!rc)
		rc = check_whole(state);
	if (rc)
		return rc;
	for (uint64_t i = 0; i < n; i++) {
		struct state_slot slot;

		memcpy(&slot, state->slots + i * ring->size, sizeof(slot));
		/* Older slots may have been overwritten. */
		if (written - (first + i) < ring->count && slot.number == first + i + 1 &&
		    !incise_state_unpack(&ticks[good], &slot.tick))
			good++;
	}
	return good;
}

static uint64_t least_state_reader(uint64_t a, uint64_t b)
{
	return a < b ? a : b;
}

int incise_state_ticks(struct incise_state *state, uint64_t *cursor,
		       struct incise_tick *ticks, int n, uint64_t *lost)
{
	const struct state_part *ring = &state->head.ring;
	uint64_t written, first = *cursor, gone = 0;
	int got = 0, good;
	int rc = copy(state, &written, sizeof(written), ring->offset);

	if (!rc)
		rc = check_whole(state);
	if (rc)
		return rc;
	__atomic_thread_fence(__ATOMIC_ACQUIRE);
	if (first > written)
		first = written;
	if (written - first > ring->count) {
		gone = written - first - ring->count;
		first += gone;
	}
	while (got < n && first < written) {
		uint64_t part = least_state_reader(
			least_state_reader(written - first, (uint64_t)(n - got)),
			least_state_reader(CHUNK, ring->count - first % ring->count));

		good = take_slots(state, first, part, ticks + got);
		if (good < 0)
			return good;
		got += good;
		gone += part - (uint64_t)good;
		first += part;
	}
	*cursor = first;
	if (lost)
		*lost += gone;
	return got;
}
