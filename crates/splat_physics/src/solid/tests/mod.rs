mod clouds;
mod sphere;

use clouds::*;
