/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A capture on a terminal: a view of the streams and single keys, which never hold up the recording,
 * and its report.
 */
#ifndef INCISE_TOOLS_CAPTURE_H
#define INCISE_TOOLS_CAPTURE_H

#include <stdbool.h>
#include <incise/capture.h>
#include "../cli/calibration.h"

/*
 * From begin to end keys come at once and are not shown, and no write to the terminal waits for it.
 * While the program is suspended (Ctrl-Z), in the background and at exit the terminal is as before.
 * @live: its clock is real. @vision: the depth is measured in frames too.
 */
void capture_view_begin(bool live, bool vision);
void capture_view_end(void);

/*
 * A step of a capture: handle the keys, and on a terminal draw at most ten times a second: traces of the
 * last seconds, and the streams. Otherwise print a line each second of a real clock on stderr.
 */
int capture_view_step(void *context, const struct incise_capture_state *state,
		      struct incise_error *err);

/* Report a recording as text or JSON. @signed_by: kind and fingerprint of the key; "": none. */
void capture_report(const char *path, const struct incise_capture_result *result,
		    const struct calibration_used *calibration, const char *signed_by,
		    bool json);

#endif
