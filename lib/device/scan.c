// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Looking for devices behind a backend; see incise/scan.h.
 */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <incise/scan.h>
#include "backends.h"

int incise_scan(const char *kind, const char *spec, incise_scan_found *found,
		void *context, struct incise_error *err)
{
	struct incise_loaded loaded = {0};
	size_t length = strcspn(spec, ":");
	char name[32], where[80];
	int rc;

	if (!spec[length] || length >= sizeof(name))
		return incise_error_set(err, EINVAL,
					"%.60s: expected BACKEND:ARGUMENTS such as "
					"can:can0; correct it",
					spec);
	snprintf(name, sizeof(name), "%.*s", (int)length, spec);
	snprintf(where, sizeof(where), "%.70s", spec);
	/* The virtual rig is whatever one asks for. */
	rc = strcmp(name, "sim") ? incise_backend_find(&loaded, kind, name, where, err)
				 : 0;
	if (rc)
		return rc;
	if (loaded.backend && loaded.backend->scan)
		rc = loaded.backend->scan(spec + length + 1, found, context, err);
	else
		rc = incise_error_set(err, EOPNOTSUPP,
				      "%s: this backend cannot look for devices; name "
				      "yours in rig.conf",
				      where);
	incise_backend_unload(&loaded);
	return rc;
}
