// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Shared objects of a process; see mapped_libraries.h.
 */
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include "json.h"
#include "mapped_libraries.h"

/* Libraries that only a process that needs them should map. */
static const struct {
	const char *part, *name;
} heavy[] = {
	{"libsqlite3", "SQLite"},
	{"liblapack", "LAPACK"},
	{"libavformat", "libavformat"},
	{"libhdf5", "HDF5"},
	{"libopencv", "OpenCV"},
	{"libGL", "OpenGL"},
	{"libSDL2", "SDL2"},
	{"libcairo", "cairo"},
	{"libusb", "libusb"},
	{"libiio", "libiio"},
	{"libcomedi", "comedilib"},
	{"libgpiod", "libgpiod"},
};
#define HEAVY (sizeof(heavy) / sizeof(*heavy))

static bool holds(const json_t *list, const char *name)
{
	for (size_t i = 0; i < json_array_size(list); i++)
		if (!strcmp(json_string_value(json_array_get(list, i)), name))
			return true;
	return false;
}

json_t *mapped_libraries(pid_t pid)
{
	json_t *list = json_array();
	char line[4096];
	FILE *maps;

	snprintf(line, sizeof(line), "/proc/%d/maps", (int)(pid ? pid : getpid()));
	maps = fopen(line, "re");
	while (maps && fgets(line, sizeof(line), maps)) {
		char *name = strrchr(line, '/');
		char code = 0;

		/* Only those with code: the loader maps its cache of all names. */
		if (sscanf(line, "%*s %*c%*c%c", &code) != 1 || code != 'x' || !name ||
		    !strstr(name, ".so"))
			continue;
		name++;
		name[strcspn(name, "\n")] = 0;
		if (!holds(list, name))
			json_array_append_new(list, json_text(name));
	}
	if (maps)
		fclose(maps);
	return list;
}

json_t *unmapped_libraries(const json_t *mapped)
{
	json_t *absent = json_array();

	for (size_t i = 0; i < HEAVY; i++) {
		bool found = false;

		for (size_t k = 0; k < json_array_size(mapped); k++)
			found |= !!strstr(json_string_value(json_array_get(mapped, k)),
					  heavy[i].part);
		if (!found)
			json_array_append_new(absent, json_string(heavy[i].name));
	}
	return absent;
}
