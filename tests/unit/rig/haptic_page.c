// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/haptic_{page,user}.c: a page has one owner and one user; samples come through whole, in their order;
 * and nothing that an owner writes gets past the user's checks.
 */
#include "../unit.h"
#include <fcntl.h>
#include <sys/stat.h>
#include "../cases.h"
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/rig/haptic_page.h"

#define START_NS (1000 * INCISE_NS_PER_S)
#define MS 1000000

static char device[60];
static struct haptic_page page;
static struct incise_clock *clock_;
static struct incise_haptic *user;
static struct incise_haptic_page_owner half;
static const struct incise_haptic_setup setup;

static void put_half(void)
{
	half.heartbeat_ns = incise_clock_now(clock_);
	incise_haptic_page_put(&page.map->owner, &half, sizeof(half));
}

static void put_sample(double x)
{
	struct incise_haptic_page_sample sample = {
		.number = half.samples,
		.sequence = 2 * half.samples,
		.t_ns = incise_clock_now(clock_) - 7,
		.position_mm = {x, 2, 3},
		.velocity_mm_s = {4, 5, 6},
		.quaternion = {1},
		.buttons = 5,
	};

	incise_haptic_page_put(&page.map->ring[half.samples++ % 32], &sample,
			       sizeof(sample));
}

static int open_page(void **state)
{
	(void)state;
	snprintf(device, sizeof(device), "local:unit-%d", (int)getpid());
	clock_ = incise_clock_new_simulated(START_NS);
	assert_int_equal(incise_haptic_page_new(&page, device, "test", &err), 0);
	page.map->device = (struct incise_haptic_info){
		.name = "unit", .rate_hz = 1000, .peak_N = 3, .features = 1};
	strcpy(page.map->device.device, device);
	half = (struct incise_haptic_page_owner){.state = INCISE_HAPTIC_PAGE_READY};
	put_half();
	incise_haptic_page_publish(page.map, 1);
	return 0;
}

static int close_page(void **state)
{
	(void)state;
	incise_haptic_close(user);
	user = NULL;
	incise_haptic_page_close(&page, true);
	incise_clock_free(clock_);
	return 0;
}

static bool attach(void)
{
	user = incise_haptic_attach("", device, "test", &setup, clock_, &err);
	return user;
}

TEST(samples_come_through_once_and_a_force_goes_back, open_page, close_page)
{
	struct incise_haptic_sample samples[40];
	struct incise_haptic_info info;
	struct stat st;

	assert_int_equal(stat(page.path, &st), 0);
	assert_int_equal(st.st_mode & 0777, 0600);
	succeeds(attach());
	incise_haptic_info(user, &info);
	assert_string_equal(info.name, "unit");
	assert_true(info.peak_N == 3 && info.rate_hz == 1000 &&
		    info.features == INCISE_HAPTIC_PAGE_VELOCITY);
	assert_int_equal(incise_haptic_read(user, samples, 40), 0);
	for (int i = 0; i < 5; i++)
		put_sample(i);
	put_half();
	assert_int_equal(incise_haptic_read(user, samples, 3), 3);
	assert_int_equal(incise_haptic_read(user, samples + 3, 40), 2);
	for (int i = 0; i < 5; i++) {
		assert_true(samples[i].position_mm[0] == i &&
			    samples[i].velocity_mm_s[2] == 6);
		assert_true(samples[i].seq == 2 * (uint64_t)i && samples[i].buttons == 5);
		assert_true(samples[i].t_ns == START_NS - 7);
	}
	assert_int_equal(incise_haptic_lost(user), 0);
	/* The ring keeps 32, of which the owner may be writing one. */
	for (int i = 5; i < 105; i++)
		put_sample(i);
	put_half();
	assert_int_equal(incise_haptic_read(user, samples, 40), 31);
	assert_true(samples[0].position_mm[0] == 74 && samples[30].position_mm[0] == 104);
	assert_int_equal(incise_haptic_lost(user), 69);
	assert_int_equal(incise_haptic_push(user, (double[]){1, 2, 3}, NULL), 0);
	assert_int_equal(incise_haptic_push(user, (double[]){NAN, 2, 3}, NULL), -EDOM);
	assert_int_equal(page.map->user.wants, INCISE_HAPTIC_PAGE_FORCE);
	assert_true(page.map->user.force_N[2] == 3 &&
		    page.map->user.heartbeat_ns == START_NS &&
		    page.map->user.period_ns == MS);
	incise_haptic_close(user);
	user = NULL;
	assert_int_equal(page.map->user.wants, INCISE_HAPTIC_PAGE_NOTHING);
	assert_true(page.map->user.force_N[2] == 0);
}

TEST(one_owner_one_user_and_a_dead_owners_page_is_replaced, open_page, close_page)
{
	struct haptic_page other;
	ino_t before;
	struct stat st;

	succeeds(attach());
	assert_null(incise_haptic_attach("", device, "test", &setup, clock_, &err));
	assert_int_equal(errno, EBUSY);
	assert_non_null(strstr(err.text, "another program uses the device"));
	assert_int_equal(incise_haptic_page_new(&other, device, "test", &err), -EBUSY);
	assert_int_equal(stat(page.path, &st), 0);
	before = st.st_ino;
	incise_haptic_page_close(&page, false); /* as by kill -9 */
	assert_null(incise_haptic_attach("", device, "test", &setup, clock_, &err));
	assert_int_equal(errno, ENOENT);
	assert_non_null(strstr(err.text, "nobody holds its lock of byte 0: its owner has "
					 "died, or holds none"));
	assert_int_equal(incise_haptic_page_new(&page, device, "test", &err), 0);
	assert_int_equal(stat(page.path, &st), 0);
	assert_true(st.st_ino != before &&
		    st.st_size == sizeof(struct incise_haptic_page));
}

TEST(a_page_without_magic_is_refused_at_once, open_page, close_page)
{
	page.map->head.magic[0] = 0;
	assert_null(incise_haptic_attach("", device, "test", &setup, clock_, &err));
	assert_int_equal(errno, EAGAIN);
	assert_non_null(strstr(err.text, page.path));
	assert_non_null(strstr(err.text, "its owner has not written the magic yet"));
}

TEST(a_property_that_makes_no_sense_is_named, open_page, close_page)
{
	struct incise_haptic_info *d = &page.map->device, good = *d;

	for (int i = 0; i < 7; i++) {
		static const char *const words[] = {
			"low_mm[2] of the device: found nan, expected a finite number;",
			"peak_N of the device: found -1, expected a finite number from 0;",
			"rate_hz of the device: found 20001, expected 1 to 20000;",
			"force_latency_ns of the device: found -5, expected 0 to 1e9;",
			"deadman_s of the device: found inf,",
			"buttons of the device: found 33, expected 0 to 32;",
			"device, name, filters or note of the device do not end with a 0;",
		};

		*d = good;
		d->low_mm[2] = i == 0 ? NAN : 0;
		d->peak_N = i == 1 ? -1 : 3;
		d->rate_hz = i == 2 ? 20001 : 1000;
		d->force_latency_ns = i == 3 ? -5 : 0;
		d->deadman_s = i == 4 ? INFINITY : 0;
		d->buttons = i == 5 ? 33 : 0;
		if (i == 6)
			memset(d->note, 'x', sizeof(d->note));
		assert_null(
			incise_haptic_attach("", device, "test", &setup, clock_, &err));
		assert_int_equal(errno, EPROTO);
		if (!strstr(err.text, words[i]))
			fail_msg("%s: %s", words[i], err.text);
	}
}

TEST(cuts_are_counted_since_the_user_came, open_page, close_page)
{
	struct incise_haptic_sample sample;
	char why[INCISE_HAPTIC_CUT_MAX];

	half.cuts = 3;
	strcpy(half.cut, "late");
	put_half();
	succeeds(attach());
	assert_int_equal(user->ops->cuts(user, why), 0);
	assert_string_equal(why, "");
	half.cuts = 5;
	memset(half.cut, '\n', sizeof(half.cut));
	put_half();
	assert_int_equal(incise_haptic_read(user, &sample, 1), 0);
	assert_int_equal(user->ops->cuts(user, why), 2);
	assert_string_equal(why, "???????????????");
}

TEST(names_are_checked)
{
	static const char *const names[] = {"local:", "local:a/b", "local:../a",
					    "local:a b"};

	for (size_t i = 0; i < sizeof(names) / sizeof(*names); i++) {
		assert_null(incise_haptic_attach("", names[i], "t", &setup, NULL, &err));
		assert_int_equal(errno, EINVAL);
	}
}

TEST(a_torn_half_gives_nothing_new_and_a_dead_owner_is_reported, open_page, close_page)
{
	struct incise_haptic_sample sample;
	char text[300];

	succeeds(attach());
	put_sample(1);
	put_half();
	page.map->owner.seq |= 1;
	assert_int_equal(incise_haptic_read(user, &sample, 1), 0);
	page.map->owner.seq++;
	page.map->ring[0].seq |= 1;
	assert_int_equal(incise_haptic_read(user, &sample, 1), 0);
	assert_int_equal(incise_haptic_lost(user), 1);
	page.map->owner.seq |= 1;
	incise_clock_wait_until(clock_, START_NS + INCISE_HAPTIC_PAGE_DEAD_NS);
	assert_int_equal(incise_haptic_read(user, &sample, 1), 0);
	incise_clock_wait_until(clock_, START_NS + INCISE_HAPTIC_PAGE_DEAD_NS + 1);
	assert_int_equal(incise_haptic_read(user, &sample, 1), -ESHUTDOWN);
	assert_int_equal(incise_haptic_push(user, (double[3]){0}, NULL), -ESHUTDOWN);
	assert_true(incise_haptic_cause(user, text, sizeof(text)) > 0);
	assert_non_null(strstr(text, "no heartbeat any more"));
}

TEST(a_sample_that_makes_no_sense_is_lost, open_page, close_page)
{
	struct incise_haptic_page_sample *slot = page.map->ring;
	struct incise_haptic_sample sample;
	char text[300];

	succeeds(attach());
	for (int i = 0; i < 7; i++) {
		put_sample(i);
		put_half();
		slot = &page.map->ring[i];
		if (i == 0)
			slot->position_mm[1] = NAN;
		else if (i == 1)
			slot->velocity_mm_s[2] = INFINITY;
		else if (i == 2)
			slot->quaternion[3] = NAN;
		else if (i == 3)
			slot->flags = 1 << INCISE_HAPTIC_FLAGS;
		else if (i == 4)
			slot->t_ns = START_NS + 1;
		else if (i == 5)
			slot->t_ns = -1;
		else
			slot->number++;
		assert_int_equal(incise_haptic_read(user, &sample, 1), 0);
		assert_int_equal(incise_haptic_lost(user), i + 1);
		if (i < 6)
			assert_true(incise_haptic_cause(user, text, sizeof(text)) > 0);
	}
}

TEST(an_owner_that_makes_no_sense_ends_the_stream, open_page, close_page)
{
	for (int i = 0; i < 10; i++) {
		struct incise_haptic_sample sample;
		char text[300];
		static const int expected[] = {EPROTO, EPROTO, EPROTO, EPROTO,	  EPROTO,
					       EPROTO, ENODEV, EIO,    ESHUTDOWN, EPROTO};

		half = (struct incise_haptic_page_owner){.state = 1,
							 .samples = 50,
							 .lost = 5,
							 .cuts = 5,
							 .reason = "the\nmotor"};
		put_half();
		succeeds(attach());
		half.error = i == 6 ? ENODEV : 7777;
		half.state = i == 0		? 4
			     : i == 1		? 0
			     : i == 6 || i == 7 ? 2
			     : i == 8		? 3
						: 1;
		half.samples -= i == 2;
		half.lost -= i == 3;
		half.cuts -= i == 9;
		put_half();
		if (i == 4)
			page.map->owner.heartbeat_ns = START_NS + 1;
		if (i == 5)
			page.map->owner.seq -= 4;
		assert_int_equal(incise_haptic_read(user, &sample, 1), -expected[i]);
		incise_haptic_cause(user, text, sizeof(text));
		assert_non_null(strstr(text, i < 6 || i == 9 ? "owner" : "the?motor"));
		/* for ever */
		put_half();
		assert_int_equal(incise_haptic_read(user, &sample, 1), -expected[i]);
		incise_haptic_close(user);
		user = NULL;
	}
}

/* Some of its words change, each to another number, to a bit more or to the end of a range. */
static void mutate(uint32_t *words, uint64_t key, uint64_t *n)
{
	static const uint32_t odd[] = {0,	   1,	       3,	  0x7ff00000,
				       0x7ff80000, 0x7fffffff, 0xffffffff};
	int changes = 1 + (int)(incise_random_bits(key, (*n)++) % 4);

	while (changes--) {
		size_t at = incise_random_bits(key, (*n)++) % (sizeof(*page.map) / 4);
		uint64_t kind = incise_random_bits(key, (*n)++);

		if (kind % 8 ==
		    0) /* of the head and the owner's half as often as of the ring */
			at = incise_random_bits(key, (*n)++) % 32;
		else if (kind % 8 < 4)
			at = 1152 / 4 + incise_random_bits(key, (*n)++) % 80;
		words[at] = kind & 16	? odd[kind / 32 % 7]
			    : kind & 32 ? words[at] ^ 1u << kind / 64 % 32
					: (uint32_t)(kind >> 32);
	}
}

TEST(no_page_gets_past_the_checks, open_page, close_page)
{
	static struct incise_haptic_page whole;
	uint64_t key = cases_seed(2), n = 0;
	int all = cases_of(100000, 5000), attached = 0, read = 0;

	for (int i = 0; i < 20; i++)
		put_sample(i);
	put_half();
	memcpy(&whole, page.map, sizeof(whole));
	for (int k = 0; k < all; k++) {
		struct incise_haptic_sample samples[32];
		struct incise_haptic_info info;
		char text[300];
		int got;

		memcpy(page.map, &whole, sizeof(whole));
		if (k & 1)
			mutate((uint32_t *)page.map, key, &n);
		if (!attach())
			continue;
		attached++;
		incise_haptic_info(user, &info);
		assert_true(info.rate_hz >= 1 && info.rate_hz <= 20000 &&
			    info.peak_N >= 0 && v3_finite(info.low_mm) &&
			    info.buttons <= 32);
		half = whole.owner;
		for (int i = 0; i < 20; i++)
			put_sample(i);
		put_half();
		mutate((uint32_t *)page.map, key, &n);
		got = incise_haptic_read(user, samples, 32);
		assert_true(got <= 32);
		for (int i = 0; i < got; i++) {
			assert_true(v3_finite(samples[i].position_mm) &&
				    v3_finite(samples[i].quaternion) &&
				    isfinite(samples[i].quaternion[3]));
			assert_true(samples[i].t_ns <= START_NS && samples[i].flags < 16);
		}
		incise_haptic_push(user, (double[]){1, 0, 0}, NULL);
		incise_haptic_cause(user, text, sizeof(text));
		read += got > 0;
		incise_haptic_close(user);
		user = NULL;
	}
	assert_true(attached > all / 2 && read > all / 4);
}
