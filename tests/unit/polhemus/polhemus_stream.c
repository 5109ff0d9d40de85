// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/polhemus/polhemus_stream.c: gaps between records of known losses, and whole streams compared
 * with the list that the emulator keeps of what it sent, on a clock of the test.
 */
#include "../unit.h"
#include "../../../lib/device/polhemus/polhemus_setup.h"
#include "../../../lib/device/polhemus/polhemus_stream.h"
#include "../../polhemus/sent.h"
#include "line.h"

/* --- gaps --- */

#define LENGTH 34
#define PERIOD_NS INT64_C(8333333)
/* Records at 120 Hz in a window of lib/rig/pace.h. */
#define WINDOW 31

static const uint8_t stations[] = {1, 2, 3, 4};
static struct polhemus_gaps gaps;

static void begin(int n, bool counts, double hz)
{
	polhemus_gaps_init(&gaps, stations, n, counts, hz, LENGTH);
}

/* A record in its turn, @k periods after the first one and @late_ns. false: refused. */
static bool take(uint64_t k, int64_t late_ns, unsigned int skipped, uint64_t *seq)
{
	struct polhemus_record record = {
		.t_ns = INT64_C(5000000000) + (int64_t)k * PERIOD_NS + late_ns,
		.station = stations[k % (uint64_t)gaps.n],
		.frame = (uint32_t)(0xfffffff0 + k / (uint64_t)gaps.n),
		.skipped = skipped,
	};

	return polhemus_gaps_add(&gaps, &record, seq);
}

/* Records from @from on, none of which is missing. */
static uint64_t take_all(uint64_t from, uint64_t n)
{
	uint64_t seq = 0;

	for (uint64_t k = from; k < from + n; k++)
		assert_true(take(k, 0, 0, &seq));
	return seq;
}

/* Of the test that runs. */
static struct bench b;

/* Bytes that were no record, and the time it took: what it makes of them at once. */
TEST(damage)
{
	static const struct {
		uint64_t missing;
		unsigned int skipped;
		int64_t late_ns;
		uint64_t reported;
	} cases[] = {
		{0, 0, 0, 0},
		{1, 34, 0, 1},
		{1, 33, 0, 1},
		{1, 35, 0, 1},
		{3, 102, 0, 3},
		{3, 100, 0, 3},
		{20, 680, 0, 20},
		/* Late by two periods as well: the bytes were one. */
		{1, 34, 2 * PERIOD_NS, 1},
		{1, 35, 2 * PERIOD_NS, 1},
		/* A byte from nowhere, and the host is late. */
		{0, 1, 3 * PERIOD_NS, 0},
		{0, 1, 0, 0},
		/* Noise between records that cost no time. */
		{0, 340, 0, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		uint64_t seq = 0;

		begin(1, false, 120);
		take_all(0, 200);
		assert_true(take(200 + cases[i].missing, cases[i].late_ns,
				 cases[i].skipped, &seq));
		if (gaps.lost != cases[i].reported || seq != 200 + cases[i].reported)
			fail_msg("case %zu: %llu lost, seq %llu", i,
				 (unsigned long long)gaps.lost, (unsigned long long)seq);
	}
}

/* Stations show up to a round; the round itself only time does, three windows later. */
TEST(order)
{
	for (int n = 1; n <= 4; n++)
		for (uint64_t missing = 0; missing < 12; missing++) {
			uint64_t seq = 0, from = 240 + missing;

			begin(n, false, 120);
			take_all(0, 240);
			assert_true(take(from, 0, 0, &seq));
			assert_int_equal(gaps.lost, missing % (uint64_t)n);
			seq = take_all(from + 1, 4 * WINDOW);
			assert_int_equal(gaps.lost, missing);
			assert_int_equal(seq, from + 4 * WINDOW);
		}
}

/* The count of frames says it at once, over its end as well. */
TEST(counted)
{
	for (int n = 1; n <= 4; n++)
		for (uint64_t missing = 0; missing < 12; missing++) {
			uint64_t seq = 0;

			begin(n, true, 120);
			take_all(0, 20);
			assert_true(take(20 + missing, 0, 0, &seq));
			assert_int_equal(gaps.lost, missing);
			assert_int_equal(seq, 20 + missing);
		}
}

/* The same one twice: the second is refused, and the next one goes on. */
TEST(doubled)
{
	for (int counts = 0; counts <= 1; counts++) {
		uint64_t seq = 0;

		begin(1, counts, 120);
		take_all(0, 200);
		assert_false(take(199, 0, 0, &seq));
		assert_true(take(200, 0, 0, &seq));
		assert_int_equal(seq, 200);
		assert_int_equal(gaps.lost, 0);
	}
}

/* Pulses from outside come when they like: only order and damage count. */
TEST(without_a_period)
{
	uint64_t seq = 0;

	begin(1, false, 0);
	take_all(0, 10);
	assert_true(take(5000, 0, 0, &seq));
	assert_int_equal(seq, 10);
	assert_true(take(5001, 0, 3 * LENGTH, &seq));
	assert_int_equal(seq, 14);
	begin(3, false, 0);
	take_all(0, 9);
	/* The first and the second of a round are missing. */
	assert_true(take(11, 0, 0, &seq));
	assert_int_equal(gaps.lost, 2);
	/* The link was gone for who knows how long: a round, so that it shows. */
	polhemus_gaps_broken(&gaps);
	assert_true(take(12, 0, 0, &seq));
	assert_int_equal(gaps.lost, 5);
}

/* A tracker that was started sends nothing, or no valid record. */
TEST(before_the_first)
{
	static const struct {
		int stations;
		bool counts, broken;
		unsigned int records_skipped;
		int64_t first; /* periods after the start */
		uint64_t lost;
	} cases[] = {
		{1, false, false, 0, 1, 0},   /* as it should be */
		{1, false, false, 0, 3, 0},   /* it takes its time */
		{1, false, false, 2, 3, 2},   /* two were no records */
		{1, false, false, 9, 3, 3},   /* not more than there was time for */
		{1, false, true, 2, 100, 99}, /* and the link was gone */
		{1, true, true, 0, 100, 99},
		{4, false, false, 1, 5, 4}, /* whole rounds */
		{4, false, true, 0, 100, 96},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct polhemus_record record = {.station = 1};
		uint64_t seq = 0;
		double hz = 120;

		begin(cases[i].stations, cases[i].counts, hz);
		polhemus_gaps_start(&gaps, 1000);
		if (cases[i].broken)
			polhemus_gaps_broken(&gaps);
		record.t_ns = 1000 + cases[i].first * gaps.period_ns;
		record.skipped = cases[i].records_skipped * gaps.length;
		assert_true(polhemus_gaps_add(&gaps, &record, &seq));
		if (seq != cases[i].lost || gaps.lost != cases[i].lost)
			fail_msg("case %zu: seq %d, lost %d", i, (int)seq,
				 (int)gaps.lost);
	}
}

/* The link was gone: the time it took is lost. */
TEST(broken)
{
	uint64_t seq = 0;

	begin(1, false, 120);
	/* Before the first record there is nothing to lose. */
	polhemus_gaps_broken(&gaps);
	take_all(0, 100);
	assert_int_equal(gaps.lost, 0);
	polhemus_gaps_broken(&gaps);
	assert_true(take(1000, 0, 0, &seq));
	assert_int_equal(seq, 1000);
	assert_int_equal(gaps.lost, 900);
	assert_true(gaps.restarted);
	/* The last one before it was held up: that makes it no shorter. */
	take_all(1001, 200);
	assert_false(gaps.restarted);
	assert_true(take(1201, PERIOD_NS, 0, &seq));
	polhemus_gaps_broken(&gaps);
	assert_true(take(1400, 0, 0, &seq));
	assert_int_equal(seq, 1400);
	assert_int_equal(gaps.lost, 900 + 198);
}

/* Records missing at the end count as well, never more than if the tracker returned. */
TEST(silent)
{
	for (int n = 1; n <= 4; n++)
		for (uint64_t missing = 1; missing < 40; missing++) {
			uint64_t seq = 0, known, next;

			begin(n, false, 120);
			assert_int_equal(polhemus_gaps_silent(&gaps, PERIOD_NS), 0);
			take_all(0, 100);
			next = 100 + missing;
			assert_int_equal(polhemus_gaps_silent(&gaps, gaps.last_ns), 0);
			known = polhemus_gaps_silent(
				&gaps, gaps.last_ns + (int64_t)missing * gaps.period_ns);
			assert_in_range(known + 2 * (uint64_t)n, missing,
					missing + 2 * n);
			polhemus_gaps_broken(&gaps);
			assert_true(take(next, 0, 0, &seq));
			assert_true(gaps.lost >= known);
		}
	begin(1, false, 0);
	take_all(0, 10);
	assert_int_equal(polhemus_gaps_silent(&gaps, INT64_C(1) << 50), 0);
}

/* --- polhemus_stream --- */

#define S INT64_C(1000000000)
#define MS INT64_C(1000000)

struct bench {
	struct emulator e;
	struct test_line line;
	struct incise_tracker_setup setup;
	struct polhemus_identity identity;
	struct polhemus_stream stream;
	/* What came out. */
	struct incise_tracker_sample *samples;
	size_t n;
	uint64_t first; /* slot of the emulator's first record */
};

static void bench_init(struct bench *b, enum emulator_kind kind, int stations)
{
	memset(b, 0, sizeof(*b));
	emulator_init(&b->e, kind, 7 * S);
	b->setup = (struct incise_tracker_setup){.n_stations = stations,
						 .hemisphere = {1, 0, 0}};
	for (int i = 0; i < stations; i++) {
		b->setup.stations[i] = (uint8_t)(i + 1);
		b->e.present[i] = true;
	}
	test_line_init(&b->line, &b->e, (int)kind);
	succeeds(!polhemus_setup(&b->line.line, &b->setup, &b->identity, "test", &err));
	assert_int_equal(polhemus_stream_init(&b->stream, &b->setup, &b->identity.layout),
			 0);
	b->samples = calloc(300000, sizeof(*b->samples));
	assert_non_null(b->samples);
}

static void bench_free(struct bench *b)
{
	polhemus_stream_free(&b->stream);
	emulator_free(&b->e);
	free(b->samples);
}

static void bench_take(struct bench *b)
{
	int n;

	while ((n = incise_ring_take(&b->stream.ring, b->samples + b->n, 100)) > 0)
		b->n += (size_t)n;
}

static void bench_run(struct bench *b, double seconds)
{
	int64_t end_ns = b->line.now_ns + (int64_t)(seconds * 1e9);

	while (b->line.now_ns < end_ns) {
		unsigned char bytes[512];
		int64_t t_ns;
		ssize_t n = b->line.line.ops->read(&b->line.line, bytes, sizeof(bytes),
						   &t_ns, 10);

		assert_true(n >= 0);
		polhemus_stream_put(&b->stream, bytes, (size_t)n, t_ns);
		bench_take(b);
	}
}

/*
 * Every record that was not touched is there, once, in order, with a seq that counts all
 * that were before it; how many touched ones are there as well.
 */
static size_t compare(struct bench *b, int64_t late_ns, uint64_t slack)
{
	size_t at = 0, extra = 0;
	uint64_t lost = polhemus_stream_lost(&b->stream);

	for (size_t i = 0; i < b->e.n_sent; i++) {
		const struct emulator_sent *sent = &b->e.sent[i];

		/* The last ones may be on their way. */
		if (at == b->n)
			break;
		if (polhemus_is_sent(&b->samples[at], sent)) {
			const struct incise_tracker_sample *s = &b->samples[at++];

			assert_true(s->t_ns >= sent->t_ns &&
				    s->t_ns <= sent->t_ns + late_ns);
			if (s->seq + slack < i || s->seq > i + slack)
				fail_msg("record %zu has seq %llu", i,
					 (unsigned long long)s->seq);
			continue;
		}
		if (!sent->touched)
			fail_msg("record %zu of slot %llu is not there", i,
				 (unsigned long long)sent->slot);
		/* It came to harm in a way that cannot be seen: at its time, from its place. */
		if (b->samples[at].station == sent->station &&
		    b->samples[at].t_ns >= sent->t_ns &&
		    b->samples[at].t_ns < sent->t_ns + 2 * MS) {
			at++;
			extra++;
		}
	}
	assert_int_equal(at, b->n);
	for (size_t i = 1; i < b->n; i++)
		assert_true(b->samples[i].seq > b->samples[i - 1].seq);
	/* All that was sent up to the last sample is there or counted. */
	assert_int_equal(b->n + lost, b->samples[b->n - 1].seq + 1);
	return extra;
}

/* Time goes on, and nobody looks: then what came meanwhile is taken at once. */
static size_t bench_late(struct bench *b, int64_t ns, unsigned char bytes[EMULATOR_ROOM])
{
	b->line.now_ns += ns;
	emulator_advance(&b->e, b->line.now_ns);
	return emulator_take(&b->e, bytes, EMULATOR_ROOM);
}

static void bench_pause(struct bench *b, double ms)
{
	unsigned char bytes[EMULATOR_ROOM];
	size_t n = bench_late(b, (int64_t)(ms * 1e6), bytes);

	polhemus_stream_put(&b->stream, bytes, n, b->line.now_ns);
	bench_take(b);
}

/* The next slots come to harm, in parts of a million. */
static void bench_harm(struct bench *b, uint64_t slots, struct emulator_damage damage)
{
	b->e.damage = damage;
	b->e.damage.from = b->e.slot;
	b->e.damage.to = b->e.slot + slots;
}

static size_t bench_touched(const struct bench *b)
{
	size_t touched = 0;

	for (size_t i = 0; i < b->e.n_sent; i++)
		touched += b->e.sent[i].touched;
	return touched;
}

/*
 * Ten minutes, and bursts of damage, of each kind and of all at once, at 1 % of the bytes, and at
 * more; what vanishes without a trace only time shows, a window and its losses later.
 */
TEST(loses_what_is_touched)
{
	static const struct {
		enum emulator_kind kind;
		int stations;
		double seconds;
		struct emulator_damage damage;
	} cases[] = {
		{EMULATOR_FASTRAK, 1, 600, {0}},
		{EMULATOR_FASTRAK, 4, 100, {0}},
		{EMULATOR_LIBERTY, 2, 50, {0}},
		{EMULATOR_PATRIOT, 1, 100, {0}},
		{EMULATOR_FASTRAK, 1, 45, {.flip = 10000}},
		{EMULATOR_FASTRAK, 1, 45, {.drop = 10000}},
		{EMULATOR_FASTRAK, 1, 45, {.insert = 10000}},
		{EMULATOR_FASTRAK, 1, 45, {.flip = 5000, .drop = 5000, .insert = 5000}},
		{EMULATOR_FASTRAK, 1, 45, {.flip = 50000}},
		{EMULATOR_FASTRAK, 3, 45, {.flip = 10000}},
		{EMULATOR_FASTRAK, 4, 45, {.flip = 5000, .drop = 5000, .insert = 5000}},
		{EMULATOR_LIBERTY, 1, 45, {.flip = 10000}},
		{EMULATOR_LIBERTY,
		 3,
		 45,
		 {.flip = 5000, .drop = 5000, .insert = 5000, .lose = 20000}},
		{EMULATOR_PATRIOT,
		 2,
		 45,
		 {.flip = 10000, .drop = 10000, .insert = 10000, .lose = 100000}},
		{EMULATOR_FASTRAK, 1, 52, {.lose = 20000}},
		{EMULATOR_FASTRAK, 2, 52, {.lose = 20000}},
		{EMULATOR_FASTRAK, 3, 52, {.lose = 20000}},
		{EMULATOR_FASTRAK, 4, 52, {.lose = 20000}},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		const struct emulator_damage *d = &cases[i].damage;
		bool bytes = d->flip || d->drop || d->insert, silent = d->lose && !bytes;
		size_t touched, extra;

		bench_init(&b, cases[i].kind, cases[i].stations);
		bench_run(&b, 2);
		bench_harm(&b, silent ? 6000 : 2400, *d);
		bench_run(&b, cases[i].seconds);
		touched = bench_touched(&b);
		extra = compare(&b, bytes ? S / 50 : 0,
				silent ? 30 * (uint64_t)cases[i].stations : 0);
		/* So it was tried. */
		if (bytes || silent)
			assert_true(touched > 60);
		if (!bytes) {
			/* Exact in the end. */
			assert_int_equal(polhemus_stream_lost(&b.stream), touched);
			assert_int_equal(b.n + touched, b.e.n_sent);
			assert_int_equal(extra, 0);
		}
		assert_true(polhemus_stream_lost(&b.stream) <= touched);
		assert_int_equal(b.e.eeprom_writes, 0);
		bench_free(&b);
	}
}

/* A longer gap is counted when three windows have shown it. */
TEST(long_gaps)
{
	static const unsigned int missing[] = {2, 3, 7, 20, 84, 114};

	for (int stations = 1; stations <= 4; stations++)
		for (size_t i = 0; i < 6; i++) {
			unsigned int rounds = missing[i] * (unsigned int)stations;

			bench_init(&b, EMULATOR_FASTRAK, stations);
			bench_run(&b, 2);
			bench_harm(&b, rounds, (struct emulator_damage){.lose = 1000000});
			bench_run(&b, (rounds + 4.0 * WINDOW) / 120);
			assert_int_equal(polhemus_stream_lost(&b.stream), rounds);
			bench_run(&b, 2);
			assert_int_equal(polhemus_stream_lost(&b.stream), rounds);
			compare(&b, 0, rounds);
			bench_free(&b);
		}
}

/* A host that looks rarely, and then gets many at once, lost nothing. */
TEST(bursts_are_no_loss)
{
	static const double pauses_ms[] = {16, 40, 130, 400};

	for (size_t p = 0; p < 4; p++) {
		bench_init(&b, EMULATOR_FASTRAK, 1);
		for (int i = 0; i < 60; i++) {
			/* A pause, and then quick for a while. */
			bench_pause(&b, pauses_ms[p]);
			bench_run(&b, 0.3);
		}
		assert_int_equal(b.n, b.e.n_sent);
		assert_int_equal(polhemus_stream_lost(&b.stream), 0);
		compare(&b, S, 0);
		bench_free(&b);
	}
}

/*
 * After a pause of the program a terminal gives 4 kB, and the rest when the kernel's worker has run,
 * which other programs may hold up: nothing is lost. Where the rest is not there, it is.
 */
TEST(rest_of_a_terminal_is_no_loss)
{
	static const int64_t worker_ms[] = {0, 3, 10, 45};

	for (size_t p = 0; p < 8; p++) {
		size_t first = 120 * LENGTH, n;
		unsigned char bytes[EMULATOR_ROOM];

		bench_init(&b, EMULATOR_FASTRAK, 1);
		bench_run(&b, 2);
		n = bench_late(&b, 1500 * MS, bytes);
		assert_true(n > first + 34);
		polhemus_stream_put(&b.stream, bytes, first, b.line.now_ns);
		b.line.now_ns += worker_ms[p % 4] * MS;
		if (p < 4)
			polhemus_stream_put(&b.stream, bytes + first, n - first,
					    b.line.now_ns);
		bench_run(&b, 2);
		assert_int_equal(b.n + (p < 4 ? 0 : n / 34 - 120), b.e.n_sent);
		assert_int_equal(polhemus_stream_lost(&b.stream),
				 p < 4 ? 0 : n / 34 - 120);
		assert_int_equal(b.samples[b.n - 1].seq + 1, b.e.n_sent);
		bench_free(&b);
	}
}

/*
 * Bytes from nowhere, and a host that is late just then: what they did not touch is there, and no
 * more is counted than they did.
 */
TEST(bursts_and_new_bytes)
{
	static const double pauses_ms[] = {5, 16, 40, 130};

	for (size_t p = 0; p < 4; p++) {
		uint64_t end;

		bench_init(&b, EMULATOR_FASTRAK, 1);
		bench_run(&b, 2);
		bench_harm(&b, 2400, (struct emulator_damage){.insert = 3000});
		end = b.e.damage.to + 240;
		while (b.e.slot < end) {
			bench_pause(&b, pauses_ms[p]);
			bench_run(&b, 0.05);
		}
		assert_true(bench_touched(&b) > 100);
		/* Time shows some of it, a window later. */
		compare(&b, S, 4 * WINDOW);
		assert_true(polhemus_stream_lost(&b.stream) <= bench_touched(&b));
		bench_free(&b);
	}
}

/* Clocks that differ by 1000 ppm, for long enough to be 8 records apart. */
TEST(drift_is_no_loss)
{
	static const double ppm[] = {-1000, 1000};

	for (int i = 0; i < 2; i++) {
		bench_init(&b, EMULATOR_FASTRAK, 1);
		bench_run(&b, 1);
		b.e.start_ns = b.e.now_ns - (int64_t)((double)b.e.slot * 1e9 / 120);
		/* The emulator's clock is ours, run faster or slower. */
		b.e.start_ns = b.e.now_ns - (int64_t)((double)b.e.slot * 1e9 /
						      (120 * (1 + ppm[i] * 1e-6)));
		b.e.hz = 120 * (1 + ppm[i] * 1e-6);
		bench_run(&b, 70);
		assert_int_equal(b.n, b.e.n_sent);
		assert_int_equal(polhemus_stream_lost(&b.stream), 0);
		bench_free(&b);
	}
}

/* The tip is where the quaternion turns it to, by a matrix that is written out. */
TEST(the_tip)
{
	bench_init(&b, EMULATOR_FASTRAK, 1);
	b.stream.setup.offset_mm[0] = 3;
	b.stream.setup.offset_mm[1] = -20;
	b.stream.setup.offset_mm[2] = 100;
	bench_run(&b, 10);
	assert_true(b.n > 1000);
	for (size_t k = 0; k < b.n; k++) {
		const struct incise_tracker_sample *s = &b.samples[k];
		struct emulator_pose pose = emulator_pose(b.e.sent[k].slot, 1);
		double w = s->quaternion[0], x = s->quaternion[1], y = s->quaternion[2],
		       z = s->quaternion[3];
		const double r[3][3] = {
			{w * w + x * x - y * y - z * z, 2 * (x * y - w * z),
			 2 * (x * z + w * y)},
			{2 * (x * y + w * z), w * w - x * x + y * y - z * z,
			 2 * (y * z - w * x)},
			{2 * (x * z - w * y), 2 * (y * z + w * x),
			 w * w - x * x - y * y + z * z},
		};

		for (int i = 0; i < 3; i++)
			/* Rounding of sums of 100. */
			assert_true(fabs((double)pose.xyz_cm[i] * 10 + r[i][0] * 3 -
					 r[i][1] * 20 + r[i][2] * 100 -
					 s->position_mm[i]) < 1e-10);
	}
	bench_free(&b);
}

/* Nobody reads: what has no room is counted, and the rest in order. */
TEST(no_room)
{
	uint64_t dropped;

	bench_init(&b, EMULATOR_FASTRAK, 1);
	for (int i = 0; i < 5000; i++) {
		unsigned char bytes[512];
		int64_t t_ns;
		ssize_t n = b.line.line.ops->read(&b.line.line, bytes, sizeof(bytes),
						  &t_ns, 10);

		polhemus_stream_put(&b.stream, bytes, (size_t)n, t_ns);
	}
	dropped = polhemus_stream_lost(&b.stream);
	bench_take(&b);
	assert_true(dropped > 500);
	assert_int_equal(b.n + dropped, b.e.n_sent);
	bench_run(&b, 1);
	assert_int_equal(b.n + dropped, b.samples[b.n - 1].seq + 1);
	bench_free(&b);
}

/* Away for a while: all that time is lost, to the record. */
TEST(pulled_out)
{
	for (int stations = 1; stations <= 3; stations++) {
		size_t was;

		bench_init(&b, EMULATOR_FASTRAK, stations);
		bench_run(&b, 2.5);
		was = b.n;
		/* Its set-up takes some of the time as well. */
		b.line.now_ns += 3 * S;
		emulator_advance(&b.e, b.line.now_ns);
		b.e.n_records = 0;
		assert_int_equal(polhemus_setup(&b.line.line, &b.setup, &b.identity,
						"test", NULL),
				 0);
		polhemus_stream_broken(&b.stream, &b.identity.layout);
		bench_run(&b, 1);
		assert_true(b.n > was + 100);
		/* By slot, as the order of stations restarts: a round at most. */
		assert_in_range(polhemus_stream_lost(&b.stream) + b.n,
				b.e.slot - b.e.sent[0].slot - (uint64_t)stations - 1,
				b.e.slot - b.e.sent[0].slot + (uint64_t)stations + 1);
		assert_int_equal(b.samples[b.n - 1].seq + 1,
				 polhemus_stream_lost(&b.stream) + b.n);
		bench_free(&b);
	}
}

/* A pose that stays the same to its last digit is flagged, from repeat_ms on; others are not. */
TEST(one_pose_again_and_again)
{
	static const struct {
		enum emulator_kind kind;
		int stations;
		double repeat_ms;
	} cases[] = {
		{EMULATOR_FASTRAK, 1, 100}, {EMULATOR_FASTRAK, 4, 100},
		{EMULATOR_LIBERTY, 2, 100}, {EMULATOR_PATRIOT, 1, 250},
		{EMULATOR_FASTRAK, 1, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		int64_t repeat_ns = (int64_t)(cases[i].repeat_ms * 1e6), from_ns, to_ns;
		int64_t since_ns[EMULATOR_STATIONS] = {0};
		size_t flagged = 0;

		bench_init(&b, cases[i].kind, cases[i].stations);
		b.stream.setup.repeat_ms = cases[i].repeat_ms;
		bench_run(&b, 2);
		from_ns = b.line.now_ns;
		b.e.frozen = true;
		b.e.frozen_slot = b.e.slot;
		bench_run(&b, 1);
		to_ns = b.line.now_ns;
		b.e.frozen = false;
		bench_run(&b, 2);
		for (size_t k = 0; k < b.n; k++) {
			const struct incise_tracker_sample *s = &b.samples[k];
			int64_t *since = &since_ns[s->station - 1];
			bool same = s->t_ns > from_ns && s->t_ns <= to_ns;

			if (same && !*since)
				*since = s->t_ns;
			same = same && repeat_ns && s->t_ns - *since > repeat_ns;
			if ((s->status == '=') != same)
				fail_msg("case %zu: sample %zu, at %.4f s, has '%c'", i,
					 k, (double)(s->t_ns - from_ns) * 1e-9,
					 s->status);
			flagged += same;
		}
		/* So it was tried. */
		assert_int_equal(flagged > 0, repeat_ns > 0);
		assert_int_equal(polhemus_stream_lost(&b.stream), 0);
		bench_free(&b);
	}
}
