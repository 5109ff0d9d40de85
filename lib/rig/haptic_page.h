/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A haptic device that another process owns, over a page in shared memory; see incise/haptic_page.h.
 *
 *     haptic_user.c ─▶ page ◀─ haptic_owner.c, in the process of incise device
 *          ╰──▶ haptic_start.c starts that process
 */
#ifndef INCISE_RIG_HAPTIC_PAGE_H
#define INCISE_RIG_HAPTIC_PAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <incise/backend.h>
#include <incise/haptic_page.h>

#define HAPTIC_PAGE_LOCAL "local:"

/* The page's samples end like those of incise/haptic.h. */
_Static_assert(sizeof(struct incise_haptic_sample) == 104 &&
		       offsetof(struct incise_haptic_page_sample, t_ns) == 16 &&
		       offsetof(struct incise_haptic_page_sample, reserved) == 16 + 104,
	       "a sample behind seq and number");

/* Copy a part; false: it was torn at each of three tries. */
static inline bool haptic_page_read(const void *part, void *to, uint32_t bytes)
{
	for (int i = 0; i < 3; i++)
		if (incise_haptic_page_get(part, to, bytes))
			return true;
	return false;
}

/* An open page, and the lock of this side; with fd -1 there is none. */
struct haptic_page {
	char path[96];
	int fd;
	struct incise_haptic_page *map;
};

/*
 * A new page of zeros for the owner of a device; one that a dead owner left is replaced. 0; -EBUSY: the
 * device has an owner; -EACCES: another user's; errno of open(2), mmap(2).
 */
int incise_haptic_page_new(struct haptic_page *page, const char *device,
			   const char *where, struct incise_error *err);

/*
 * The page of a device for its only user. 0; -ENOENT: it has no owner, or one without its lock; -EAGAIN: its
 * owner prepares it; -EBUSY: it has a user; -EACCES; -EPROTO: the page has another layout.
 */
int incise_haptic_page_open(struct haptic_page *page, const char *device,
			    const char *where, struct incise_error *err);

/* Close it, which frees the lock; @remove its name, too. */
void incise_haptic_page_close(struct haptic_page *page, bool remove);

/* Whether a living process holds the lock of a side. */
bool incise_haptic_page_held(const struct haptic_page *page, int byte);

/* The settings in place of the device's own. */
void incise_haptic_set_info(struct incise_haptic *haptic,
			    const struct incise_haptic_setup *setup);

/* A number that changes when the settings do. */
uint32_t incise_haptic_page_settings(const struct incise_haptic_setup *setup);

/*
 * The force that an owner gives:
 *
 *     age of the user's heartbeat    0 ── 1 period ── 2 periods ─▶
 *     its half is whole, valid       all of it ──────▶ 0            at once
 *     torn at each try               all of it  fades to 0          linearly
 *
 * After each 0 it returns by a ramp.
 */
struct haptic_gate {
	double peak_N, torque_N_mm; /* limits of the device; 0: nothing is given */
	int64_t gap_ns;		    /* between decisions, of a slow device; else 20 ms */
	struct incise_haptic_page_user last; /* whole and valid half */
	double share;			     /* 0 … 1, of its force */
	int64_t now_ns;			     /* of the last decision; 0: none */
};

/*
 * Decide at a time. @half: NULL: torn. Returns why there is no force, or less; NULL: nothing reduces it but
 * the ramp. A pure function.
 */
const char *incise_haptic_gate(struct haptic_gate *gate,
			       const struct incise_haptic_page_user *half, int64_t now_ns,
			       double force_N[3], double torque_N_mm[3]) INCISE_REALTIME;

/* Start incise device for a rig, and wait until it is ready. 0; -ENOENT (no such program), its errno, or -EIO. */
int incise_haptic_start_owner(const char *spec, const char *where,
			      struct incise_error *err);

/*
 * Attach to the page of a device: of "local:NAME", which somebody's own process serves; or of any other
 * backend, whose owner `incise device` is started unless it runs. @spec: of the rig, which the owner
 * reads its settings from. Waits until an owner that it starts is ready.
 *
 * NULL with errno of incise_haptic_open(); ENOENT (nobody serves that page), EAGAIN (its owner, which somebody
 * else started, is not ready yet), EBUSY (another
 * program uses it), EPROTO (a page of another version, or not understood).
 */
struct incise_haptic *incise_haptic_attach(const char *spec, const char *device,
					   const char *where,
					   const struct incise_haptic_setup *setup,
					   struct incise_clock *clock,
					   struct incise_error *err);

#endif
