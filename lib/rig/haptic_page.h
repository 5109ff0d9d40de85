/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The user's end of a haptic device that another process owns; see incise/haptic_page.h.
 */
#ifndef INCISE_RIG_HAPTIC_PAGE_H
#define INCISE_RIG_HAPTIC_PAGE_H

#include <incise/haptic.h>

/*
 * Attach to the page of a device: of "local:NAME", which somebody's own process serves; or of any other
 * backend, whose owner `incise device` is started unless it runs. @spec: of the rig, which the owner
 * reads its settings from. Waits until the owner is ready.
 *
 * NULL with errno of incise_haptic_open(); ENOENT (nobody serves that page), EBUSY (another
 * program uses it), EPROTO (a page of another version, or not understood).
 */
struct incise_haptic *incise_haptic_attach(const char *spec, const char *device,
					   const char *where,
					   const struct incise_haptic_setup *setup,
					   struct incise_clock *clock,
					   struct incise_error *err);

#endif
