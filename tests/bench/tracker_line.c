// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A FASTRAK at a serial line for ten minutes, in real time: all of lib/device/polhemus with its
 * thread, and the emulator of tests/polhemus behind a pseudo terminal.
 *
 *   tracker_line [SECONDS]
 *
 * Several lines run at once: one is clean, one has 1 % of its bytes changed, on one bytes
 * come and go as well, on one whole records vanish, which only time shows. Each sample
 * is held against the emulator's own list of what it sent. What is reported:
 *
 *   sent = came + lost          came = whole + unseen
 *
 * where unseen ones came to harm in a way that no program can see. 0 when no record is missing
 * without being counted, none is there twice, and none is lost that was not touched.
 */
#include <errno.h>
#include <math.h>
#include "../../lib/device/polhemus/polhemus_tracker.h"
#include "../../lib/device/polhemus/polhemus_tty.h"
#include "../polhemus/sent.h"
#include "../unit/polhemus/pty.h"

#define HZ 120
#define BEFORE 5 /* s without harm, while it is set up and after */
#define AFTER 5	 /* s: losses that only time shows are reported half a second later */

static const struct incise_tracker_setup setup = {
	.n_stations = 1, .stations = {1}, .hemisphere = {1, 0, 0}};

struct line {
	const char *name;
	struct emulator_damage damage;
	struct pty pty;
	struct incise_tracker *tracker;
	struct incise_tracker_sample *samples;
	size_t n, capacity;
	uint64_t lost;
};

static struct line lines[] = {
	{.name = "clean"},
	{.name = "1 % of bytes changed", .damage = {.flip = 10000}},
	{.name = "bytes changed, gone and new",
	 .damage = {.flip = 3000, .drop = 3000, .insert = 3000}},
	{.name = "1 % of records gone", .damage = {.lose = 10000}},
};
#define LINES (sizeof(lines) / sizeof(*lines))

static int begin(struct line *l, int seconds)
{
	struct incise_error err = {0};
	struct polhemus_line *tty;

	l->capacity = (size_t)(seconds + 10) * HZ;
	l->samples = calloc(l->capacity, sizeof(*l->samples));
	if (!l->samples || pty_begin(&l->pty, EMULATOR_FASTRAK)) {
		perror("tracker_line");
		return -1;
	}
	l->damage.from = BEFORE * HZ;
	l->damage.to = (uint64_t)(seconds > BEFORE + AFTER ? seconds - AFTER : 0) * HZ;
	l->pty.emulator.damage = l->damage;
	tty = polhemus_tty_open(l->pty.path, "tracker_line", &err);
	l->tracker = tty ? polhemus_tracker_open(tty, &setup, &POLHEMUS_TIMES,
						 "tracker_line", &err)
			 : NULL;
	if (!l->tracker)
		fprintf(stderr, "%s\n", err.text);
	return l->tracker ? 0 : -1;
}

static int take(struct line *l)
{
	size_t left = l->capacity - l->n;
	int n = incise_tracker_read(l->tracker, l->samples + l->n,
				    left < 1000 ? (int)left : 1000);

	if (n > 0)
		l->n += (size_t)n;
	return n;
}

static void end(struct line *l)
{
	/* What is on its way is not looked at. */
	usleep(200000);
	take(l);
	l->lost = incise_tracker_lost(l->tracker);
	l->tracker->ops->close(l->tracker);
	pty_unplug(&l->pty);
}

/* Whether all is as it should be. */
static bool compare(const struct line *l)
{
	const struct emulator *e = &l->pty.emulator;
	size_t touched = 0, unseen = 0, missed = 0, doubled = 0, at = 0;
	int64_t late_ns = 0;
	uint64_t end_seq = l->n ? l->samples[l->n - 1].seq + 1 : 0;

	for (size_t i = 0; i < e->n_sent; i++)
		touched += e->sent[i].touched;
	for (size_t i = 0; i < l->n; i++) {
		const struct incise_tracker_sample *s = &l->samples[i];
		size_t from = at;

		doubled += i && s->seq <= s[-1].seq;
		while (at < e->n_sent && e->sent[at].t_ns <= s->t_ns &&
		       !polhemus_is_sent(s, &e->sent[at]))
			at++;
		if (at == e->n_sent || e->sent[at].t_ns > s->t_ns) {
			/* None that was sent, so one that came to harm. */
			unseen++;
			at = from;
			continue;
		}
		for (; from < at; from++)
			missed += !e->sent[from].touched;
		late_ns = s->t_ns - e->sent[at].t_ns > late_ns
				  ? s->t_ns - e->sent[at].t_ns
				  : late_ns;
		at++;
	}
	printf("%s: %zu sent, %zu touched, %zu came, %llu lost, %zu unseen, %zu missed that "
	       "were not touched, %zu doubled; %.1f ms late at most; eeprom %d\n",
	       l->name, e->n_sent, touched, l->n, (unsigned long long)l->lost, unseen,
	       missed, doubled, (double)late_ns * 1e-6, e->eeprom_writes);
	return !doubled && !e->eeprom_writes && l->n + l->lost == end_seq &&
	       at == end_seq && e->n_sent - at < HZ && unseen <= touched && !missed &&
	       l->lost + unseen <= touched;
}

int main(int argc, char **argv)
{
	int seconds = argc > 1 ? atoi(argv[1]) : 600, rc = 0;
	int64_t end_ns;

	for (size_t i = 0; i < LINES; i++)
		if (begin(&lines[i], seconds))
			return 1;
	end_ns = now_ns() + seconds * INT64_C(1000000000);
	while (!rc && now_ns() < end_ns) {
		usleep(20000);
		for (size_t i = 0; i < LINES; i++)
			if (take(&lines[i]) < 0) {
				fprintf(stderr, "%s: it went away\n", lines[i].name);
				rc = 1;
			}
	}
	for (size_t i = 0; i < LINES; i++)
		end(&lines[i]);
	printf("%d s:\n", seconds);
	for (size_t i = 0; i < LINES; i++) {
		if (!compare(&lines[i])) {
			printf("not as it should be: %s\n", lines[i].name);
			rc = 1;
		}
		pty_end(&lines[i].pty);
		free(lines[i].samples);
	}
	return rc;
}
