// A flanged bearing bracket, modelled for this project: 15 primitives.
$fn = 96;

difference() {
    union() {
        translate([0, 0, 4]) cube([80, 50, 8], center = true);       // base plate
        translate([-40, 0, 4]) cylinder(r = 25, h = 8, center = true); // rounded ends
        translate([40, 0, 4]) cylinder(r = 25, h = 8, center = true);
        translate([0, 0, 22]) cylinder(r = 18, h = 28, center = true); // bearing seat
        translate([0, 0, 14]) cylinder(r1 = 24, r2 = 18, h = 12, center = true); // its foot
        translate([0, 19, 15]) cube([6, 12, 14], center = true);       // ribs
        translate([0, -19, 15]) cube([6, 12, 14], center = true);
        translate([18, 0, 26]) sphere(r = 5);                          // grease nipple
    }
    translate([0, 0, 18]) cylinder(r = 10, h = 44, center = true);     // shaft
    translate([0, 0, 33]) cylinder(r1 = 10, r2 = 14, h = 8, center = true); // its chamfer
    translate([-48, 0, 4]) cylinder(r = 5, h = 12, center = true);     // bolt holes
    translate([48, 0, 4]) cylinder(r = 5, h = 12, center = true);
    translate([-48, 0, 6.5]) cylinder(r1 = 5, r2 = 10, h = 5, center = true); // countersinks
    translate([48, 0, 6.5]) cylinder(r1 = 5, r2 = 10, h = 5, center = true);
    translate([0, 0, 2]) cylinder(r = 14, h = 6, center = true);        // recess below
}
