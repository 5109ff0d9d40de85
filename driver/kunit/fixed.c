// SPDX-License-Identifier: GPL-2.0-only
/*
 * The integer force model, as the kernel's compiler makes it: the same bits as in a
 * program. Random inputs of trial.h go in, a CRC-32C of all results comes out; a program
 * (tests/vm/guest/fixed_bits.c) computes the same and hands over its result:
 *
 *   insmod incise_kunit.ko blob=MODEL.fx count=N seed=S digest=CRC
 *
 * For each input: the evaluator's output, the force of reaction and plane; 4 s32.
 */
#include <linux/crc32c.h>
#include <linux/kernel_read_file.h>
#include <linux/moduleparam.h>
#include <linux/sched.h>
#include <linux/vmalloc.h>

#include "trial.h"
#include "fixed.h"

static char *blob;
module_param(blob, charp, 0);
MODULE_PARM_DESC(blob, "Path of a compiled model");

static unsigned int count;
module_param(count, uint, 0);
MODULE_PARM_DESC(count, "Random inputs");

static unsigned long long seed;
module_param(seed, ullong, 0);
MODULE_PARM_DESC(seed, "Seed of the random inputs");

static unsigned int digest;
module_param(digest, uint, 0);
MODULE_PARM_DESC(digest, "CRC-32C of all results, by a program");

static u32 fixed_digest(const struct incise_fixed *fx, u32 n, u64 state)
{
	static struct incise_fx_trial_cut cut;
	s32 x[INCISE_FIXED_INPUTS_MAX], result[4];
	u32 crc = ~0U, i;

	for (i = 0; i < n; i++) {
		incise_fx_trial_inputs(&state, fx, x);
		result[0] = incise_fixed_eval(fx, x);
		incise_fx_trial_force(&state, &cut, &result[1]);
		crc = crc32c(crc, result, sizeof(result));
		cond_resched();
	}
	return ~crc;
}

/* Its bytes, to be vfree()d; NULL: not given, or a failure that was reported. */
static u8 *fixed_blob(struct kunit *test, u32 *size)
{
	void *bytes = NULL;
	ssize_t n;

	if (!blob) {
		kunit_mark_skipped(test, "no blob was given");
		return NULL;
	}
	n = kernel_read_file_from_path(blob, 0, &bytes, INCISE_FIXED_SIZE_MAX, NULL,
				       READING_FIRMWARE);
	if (n < 0) {
		KUNIT_FAIL(test, "the blob cannot be read");
		return NULL;
	}
	*size = n;
	return bytes;
}

void fixed_bits(struct kunit *test)
{
	struct incise_fixed fx;
	u32 size;
	u8 *bytes = fixed_blob(test, &size);

	if (!bytes)
		return;
	if (incise_fixed_open(&fx, bytes, size))
		KUNIT_FAIL(test, "the blob is rejected");
	else
		KUNIT_EXPECT_EQ(test, fixed_digest(&fx, count, seed), digest);
	vfree(bytes);
}

/* A blob with one bit changed anywhere is no blob. */
void fixed_damage(struct kunit *test)
{
	struct incise_fixed fx;
	unsigned int i, taken = 0;
	u32 size, at;
	u8 *bytes = fixed_blob(test, &size);

	if (!bytes)
		return;
	for (i = 0; i < 200; i++) {
		at = (u64)size * i / 200;
		bytes[at] ^= 1 << i % 8;
		taken += !incise_fixed_open(&fx, bytes, size);
		bytes[at] ^= 1 << i % 8;
	}
	KUNIT_EXPECT_EQ(test, taken, 0U);
	vfree(bytes);
}
