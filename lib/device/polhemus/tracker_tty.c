// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The module of a tracker of Polhemus at a serial line: "tty:/dev/ttyUSB0:115200".
 */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "polhemus_setup.h"
#include "polhemus_tracker.h"
#include "polhemus_tty.h"

#define BY_ID "/dev/serial/by-id"

static void *open_tracker(const struct incise_backend_request *request,
			  struct incise_error *err)
{
	struct polhemus_line *line =
		polhemus_tty_open(request->arguments, request->where, err);

	return line ? polhemus_tracker_open(line, request->tracker, &POLHEMUS_TIMES,
					    request->where, err)
		    : NULL;
}

/* Nobody can see what is behind a line; to ask each would disturb who does not expect it. */
static int list_lines(incise_scan_found *found, void *context)
{
	DIR *folder = opendir(BY_ID);
	struct dirent *entry;
	int rc = 0;

	while (folder && !rc && (entry = readdir(folder))) {
		struct incise_scan_device device = {0};

		if (entry->d_name[0] == '.')
			continue;
		if (snprintf(device.device, sizeof(device.device),
			     "tty:" BY_ID "/%s:115200",
			     entry->d_name) >= (int)sizeof(device.device))
			continue;
		device.usable = true;
		snprintf(device.what, sizeof(device.what),
			 "a serial line, not asked; behind it may be a tracker");
		rc = found(context, &device);
	}
	if (folder)
		closedir(folder);
	return rc;
}

/* A line that is named is asked who is there. */
static int scan(const char *arguments, incise_scan_found *found, void *context,
		struct incise_error *err)
{
	struct incise_scan_device device = {0};
	struct polhemus_identity identity;
	struct polhemus_line *line;
	char where[120], sensors[8];
	int rc;

	if (!*arguments)
		return list_lines(found, context);
	snprintf(where, sizeof(where), "tty:%.100s", arguments);
	line = polhemus_tty_open(arguments, where, err);
	if (!line)
		return -errno;
	rc = polhemus_identify(line, &identity, where, err);
	line->ops->close(line);
	if (rc)
		return rc;
	if (snprintf(device.device, sizeof(device.device), "tty:%s", arguments) >=
	    (int)sizeof(device.device))
		return incise_error_set(
			err, EINVAL,
			"%s: the path is too long to be shown: name it by a "
			"shorter one",
			where);
	device.usable = true;
	snprintf(device.what, sizeof(device.what), "%s", identity.name);
	incise_scan_tell(&device, "family", "%s",
			 polhemus_family_name(identity.layout.family));
	if (identity.version[0])
		incise_scan_tell(&device, "firmware", "%s", identity.version);
	if (identity.sensors >= 0) {
		size_t n = 0;

		for (int i = 0; i < POLHEMUS_STATIONS; i++)
			if (identity.sensors >> i & 1)
				sensors[n++] = (char)('1' + i);
		sensors[n] = '\0';
		incise_scan_tell(&device, "sensors", "%s", sensors);
	}
	/* Of a FASTRAK, of when it was switched on. */
	if (identity.test_error)
		incise_scan_tell(&device, "self_test_error", "%d", identity.test_error);
	return found(context, &device);
}

const struct incise_backend incise_backend = {
	.abi = INCISE_BACKEND_ABI,
	.kind = "tracker",
	.name = "tty",
	.open = open_tracker,
	.scan = scan,
};
