"""The bodies on the page: solids, shadows, target pose, forces, footprints; and the mouse that pushes one."""
