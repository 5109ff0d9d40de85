// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Losses found by times alone (lib/rig/pace.h): each source here knows what it left out.
 */
#include "../unit.h"
#include "../../../lib/rig/pace.h"
#include "../cases.h"

#define START_NS INT64_C(5000000000)

static double uniform(void)
{
	return (double)rand() / RAND_MAX;
}

static double between(double from, double to)
{
	return from + (to - from) * uniform();
}

struct source {
	const char *name;
	double rate_hz;	 /* nominal */
	double true_hz;	 /* of its clock */
	double jitter_T; /* of its times, periods, uniform */
	int chunk;	 /* samples come in chunks of one lateness */
	int hole, missing;
	int slack; /* of the number found; then it is said to be unsure */
};

TEST(counts_what_is_missing)
{
	static const struct source sources[] = {
		{"exact", 1000, 1000, 0, 1, 0, 0, 0},
		{"one lost", 1000, 1000, 0, 1, 4000, 1, 0},
		{"one lost of a clock that is off", 1000, 1000.1, 0, 1, 4000, 1, 0},
		{"five lost", 100, 100, 0, 1, 800, 5, 0},
		{"slow by 5 %", 1000, 950, 0, 1, 0, 0, 0},
		{"fast by 5 %", 1000, 1050, 0, 1, 0, 0, 0},
		{"slow by 5 %, and five lost", 1000, 950, 0, 1, 9000, 5, 0},
		{"jitter of a period", 1000, 1000, 1, 1, 0, 0, 0},
		{"jitter of chunks", 1000, 980, 20, 20, 0, 0, 10},
		{"fifty lost in the jitter of chunks", 1000, 1000, 20, 20, 12000, 50, 2},
		{"five lost in it", 1000, 1000, 20, 20, 12000, 5, 2},
		{"a hole of two seconds", 1000, 1000, 1, 1, 6000, 2000, 0},
		{"slow, and five lost", 10, 10, 0, 1, 100, 5, 0},
	};

	for (size_t k = 0; k < sizeof(sources) / sizeof(*sources); k++) {
		const struct source *s = &sources[k];
		struct incise_pace pace;
		double late = 0;
		int found = 0;

		srand(1);
		incise_pace_init(&pace, s->rate_hz, INCISE_PACE_OFF, 1);
		for (int i = 0; i < 20 * (int)s->rate_hz; i++) {
			int64_t t_ns;

			if (i % s->chunk == 0)
				late = s->jitter_T * uniform();
			if (i >= s->hole && i < s->hole + s->missing)
				continue;
			t_ns = START_NS + (int64_t)((i + late) * 1e9 / s->true_hz);
			found += (int)incise_pace_add(&pace, t_ns, t_ns);
		}
		if (abs(found - s->missing) > s->slack || (s->slack && !pace.unsure))
			fail_msg("%s: %d found, %d expected", s->name, found, s->missing);
	}
}

TEST(takes_any_time)
{
	static const int64_t times[] = {0, INT64_MAX, INT64_MIN, -1, 1, INT64_MAX / 2, 0};
	struct incise_pace pace;

	incise_pace_init(&pace, 1000, INCISE_PACE_OFF, 1);
	for (int i = 0; i < 7000; i++)
		assert_true(incise_pace_add(&pace, times[i % 7], 0) <= 1000000000);
	assert_true(isfinite(pace.period_ns));
}

/* The link was gone: what is missing counts at once. */
TEST(broken_link)
{
	struct incise_pace pace;
	uint64_t found = 0;

	incise_pace_init(&pace, 1000, INCISE_PACE_OFF, 1);
	incise_pace_broken(&pace);
	for (int i = 0; i < 3000; i++) {
		if (i == 2000)
			incise_pace_broken(&pace);
		if (i < 2000 || i >= 2700)
			found += incise_pace_add(&pace, START_NS + i * INT64_C(1000000),
						 START_NS);
		assert_int_equal(found, i < 2700 ? 0 : 700);
	}
}

/* --- sources at random --- */

#define SAMPLES 60000
#define SET_AT (SAMPLES * 2 / 5)

/* Ways of samples to their times. */
enum way {
	EVEN,	/* jitter of less than half a period */
	JITTER, /* of up to a period */
	FIFO,	/* so many at once, when the last one was taken */
	POLLED, /* a host looks at times of its own */
	CHUNKS, /* each late by up to 3 periods */
	TIMER,	/* all that have come a while after the first one, on a busy host */
	WAYS,
};

struct play {
	enum way way;
	double T_ns, ppm;   /* true period, and by how much the nominal one is longer */
	double size, phase; /* of blocks, periods */
	double jitter, late;
	bool overruns; /* a FIFO loses all of it */
	/* Times are held up, or stand still, so many times; from SET_AT on they are off. */
	int stalls, stuck;
	int64_t set_ns;
	int missing;
	bool lost[SAMPLES];
};

/* Losses everywhere but near the ends, where nothing shows them: alone, and many at a time. */
static void lose_some(struct play *p, int quiet)
{
	int losses = rand() % 12;

	for (int k = 0; k < losses; k++) {
		int at = quiet + rand() % (SAMPLES - 2 * quiet);
		int n = rand() % 2 ? 1 : 1 + rand() % 100;

		if (p->overruns) {
			n = (int)p->size * (1 + rand() % 3);
			at -= at % (int)p->size;
		}
		/* Nothing tells them from a clock that is set just then. */
		if (p->set_ns && abs(at - SET_AT) < quiet)
			continue;
		for (int i = at; i < at + n && i < SAMPLES - quiet; i++) {
			p->missing += !p->lost[i];
			p->lost[i] = true;
		}
	}
}

static void draw_play(struct play *p)
{
	int quiet;

	*p = (struct play){
		.way = (enum way)(rand() % WAYS),
		.T_ns = pow(10, between(5, 7)),
		.ppm = between(-200, 200),
		.phase = uniform(),
		.stalls = rand() % 3 ? 0 : rand() % 5,
		.stuck = rand() % 3 ? 0 : rand() % 3,
		.set_ns = rand() % 3 ? 0 : llround(pow(10, between(7.8, 12))),
	};
	if (rand() % 2)
		p->set_ns = -p->set_ns;
	p->jitter = p->way == EVEN     ? between(0, 0.4)
		    : p->way == JITTER ? 0.95
				       : between(1, 2.5);
	p->size = p->way == CHUNKS ? 5 + rand() % 15 : 2 + rand() % 63;
	if (p->way == POLLED || p->way == TIMER)
		p->size = between(1.2, 8);
	/* A whole number is the case of another test. */
	if (p->way == POLLED && fabs(p->size - round(p->size)) < 0.06)
		p->size += 0.12;
	p->overruns = p->way == FIFO && rand() % 2;
	/* Windows of 0.25 s, or of 64 blocks. */
	quiet = 4000 + (int)(1.25e9 / p->T_ns + 130 * p->size);
	lose_some(p, p->way == CHUNKS && quiet < 15000 ? 15000 : quiet);
}

/* When the block of sample @i is handed on, in periods; @kept: how many came before it. */
static double handed_on(const struct play *p, int i, int kept)
{
	int size = (int)p->size, last = i, more;

	switch (p->way) {
	case FIFO:
		if (p->overruns)
			return (double)(i / size * size + size - 1);
		/* It waits until it is full. */
		for (more = size - 1 - kept % size; more > 0 && last + 1 < SAMPLES;)
			more -= !p->lost[++last];
		return last;
	case POLLED:
		return (ceil(i / p->size + p->phase) - p->phase) * p->size;
	case TIMER:
		return p->late;
	case CHUNKS:
		return i / size * size + size - 1 + p->late;
	default:
		return i + p->jitter * uniform();
	}
}

static int64_t held_up(const struct play *p, int64_t t_ns)
{
	for (int k = 0; k < p->stalls; k++) {
		int64_t from_ns = START_NS + llround((k + 1.0) * SAMPLES /
						     (p->stalls + 2) * p->T_ns);
		int64_t to_ns = from_ns + 100000000 * (k + 1);

		if (t_ns >= from_ns && t_ns < to_ns)
			return to_ns;
	}
	return t_ns;
}

static bool is_stuck(const struct play *p, int i)
{
	int between_two = SAMPLES / (p->stuck + 1);

	return i >= between_two && i % between_two < 100;
}

/* Returns how many were found. */
static int play(struct play *p, struct incise_pace *pace)
{
	int64_t t_ns = 0, before_ns = 0, stuck_ns = 0, arrival_ns;
	int found = 0, kept = 0, chunk = -1;

	incise_pace_init(pace, 1e9 / (p->T_ns * (1 + p->ppm * 1e-6)),
			 p->way == POLLED || p->way == TIMER ? 2e-3 : INCISE_PACE_OFF, 1);
	for (int i = 0; i < SAMPLES; i++) {
		if (p->lost[i])
			continue;
		if (p->way == TIMER && i >= p->late)
			p->late = i + p->size - 0.2 * log(1 - 0.999 * uniform());
		if (p->way == CHUNKS && i / (int)p->size != chunk)
			p->late = p->jitter * uniform();
		chunk = i / (int)p->size;
		t_ns = START_NS + llround(handed_on(p, i, kept++) * p->T_ns);
		t_ns = held_up(p, t_ns);
		if (t_ns < before_ns && p->way > JITTER)
			t_ns = before_ns;
		before_ns = t_ns;
		/* A host that looks each 5 ms. */
		arrival_ns = (t_ns / 5000000 + 1) * 5000000;
		t_ns = is_stuck(p, i) ? stuck_ns : t_ns + (i > SET_AT ? p->set_ns : 0);
		stuck_ns = t_ns;
		found += (int)incise_pace_add(pace, t_ns, arrival_ns);
	}
	return found;
}

/* Losses are exact, or said not to be, which few need. */
TEST(sources_at_random)
{
	static struct play p;
	int n = cases_of(1000, 1), unsure = 0;
	struct incise_pace pace;

	for (int seed = 1; seed <= n; seed++) {
		int found;

		srand((unsigned int)seed);
		draw_play(&p);
		found = play(&p, &pace);
		if (found != p.missing && !pace.unsure)
			fail_msg("seed %d: way %d of %.3f, period %.3f ms, %.0f ppm, %d "
				 "stalls, %d stuck, set by %.3f ms: %d found, %d missing",
				 seed, (int)p.way, p.size, p.T_ns * 1e-6, p.ppm, p.stalls,
				 p.stuck, (double)p.set_ns * 1e-6, found, p.missing);
		unsure += pace.unsure;
	}
	assert_true(unsure <= n / 10);
}

/* A host that looks at a whole multiple of the period: one may be missing, or late by a look. */
TEST(resonance_is_said)
{
	static struct play p;

	for (int seed = 1; seed <= cases_of(40, 4); seed++) {
		struct incise_pace pace;
		int found;

		srand((unsigned int)seed);
		p = (struct play){
			.way = POLLED,
			.T_ns = 8.333e6,
			.ppm = between(-200, 200),
			.size = (double)(2 + rand() % 6) * (1 + between(-1e-4, 1e-4)),
			.phase = uniform(),
		};
		lose_some(&p, 4000);
		found = play(&p, &pace);
		if (found > p.missing || (found != p.missing && !pace.unsure))
			fail_msg("seed %d: looks each %.6f: %d found, %d missing", seed,
				 p.size, found, p.missing);
	}
}

/* A block has the time of its last sample. */
TEST(blocks_are_spread)
{
	for (int size = 1; size <= 64; size *= 2) {
		struct incise_pace pace;

		incise_pace_init(&pace, 1000, INCISE_PACE_OFF, 1);
		for (int i = 0; i < 5000; i++) {
			int64_t due_ns = START_NS + i * INT64_C(1000100);
			int64_t last_ns = START_NS +
					  (i / size * size + size - 1) * INT64_C(1000100);

			incise_pace_add(&pace, last_ns, last_ns);
			/* From the third on, in which the period has not been measured. */
			if (i >= 2 * size)
				assert_true(llabs(last_ns - incise_pace_spread_ns(&pace) -
						  due_ns) < 10000);
		}
	}
}
